# SPDX-License-Identifier: MIT
# Cortex-M33: Armv8-M Mainline, FPU for float.
set(BLW_CPU_FLAGS "-mcpu=cortex-m33 -mfloat-abi=hard -mfpu=fpv5-sp-d16")
set(BLW_BOARD mps2_an505)
set(BLW_QEMU_MACHINE mps2-an505)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
