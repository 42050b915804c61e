# SPDX-License-Identifier: MIT
# Cortex-M55: Armv8.1-M, FPU for float and double.  Not its vector unit for floats: that one takes
# subnormal numbers for zero, so its bits would differ.
set(BLW_CPU_FLAGS "-mcpu=cortex-m55+nomve.fp -mfloat-abi=hard")
set(BLW_BOARD mps3_an547)
set(BLW_QEMU_MACHINE mps3-an547)
include(${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake)
