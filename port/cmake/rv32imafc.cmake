# SPDX-License-Identifier: MIT
# RISC-V, 32 bits, FPU for float.
set(BLW_CPU_FLAGS "-march=rv32imafc -mabi=ilp32f")
set(BLW_QEMU qemu-system-riscv32)
include(${CMAKE_CURRENT_LIST_DIR}/riscv.cmake)
