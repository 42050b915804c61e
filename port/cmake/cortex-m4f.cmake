# SPDX-License-Identifier: MIT
# Cortex-M4F: Armv7E-M, FPU for float.
set(BLW_CPU_FLAGS "-mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16")
set(BLW_BOARD mps2)
set(BLW_QEMU_MACHINE mps2-an386)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
