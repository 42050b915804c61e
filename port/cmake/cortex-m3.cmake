# SPDX-License-Identifier: MIT
# Cortex-M3: Armv7-M, no FPU.
set(BLW_CPU_FLAGS "-mcpu=cortex-m3")
set(BLW_BOARD mps2)
set(BLW_QEMU_MACHINE mps2-an385)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
