# SPDX-License-Identifier: MIT
# RISC-V, 32 bits, no FPU.
set(BLW_CPU_FLAGS "-march=rv32imac -mabi=ilp32")
set(BLW_QEMU qemu-system-riscv32)
include(${CMAKE_CURRENT_LIST_DIR}/riscv.cmake)
