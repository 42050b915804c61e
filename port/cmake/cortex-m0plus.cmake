# SPDX-License-Identifier: MIT
# Cortex-M0+: Armv6-M, no FPU.  QEMU has a Cortex-M0, the same instruction set.
set(BLW_CPU_FLAGS "-mcpu=cortex-m0plus")
set(BLW_BOARD microbit)
set(BLW_QEMU_MACHINE microbit)
# Programs that the micro:bit cannot hold: a larger core runs the same instructions.
set(BLW_LARGE_BOARD mps2)
set(BLW_LARGE_QEMU_MACHINE mps2-an385)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
