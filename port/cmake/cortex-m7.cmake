# SPDX-License-Identifier: MIT
# Cortex-M7: Armv7E-M, FPU for float and double.
set(BLW_CPU_FLAGS "-mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16")
set(BLW_BOARD mps2)
set(BLW_QEMU_MACHINE mps2-an500)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
