# SPDX-License-Identifier: MIT
# RISC-V, 64 bits, FPU for float and double.
set(BLW_CPU_FLAGS "-march=rv64gc -mabi=lp64d")
set(BLW_QEMU qemu-system-riscv64)
include(${CMAKE_CURRENT_LIST_DIR}/riscv.cmake)
