# SPDX-License-Identifier: MIT
# What the toolchain files of all Cortex-M share.  The including file has set
#   BLW_CPU_FLAGS      -mcpu and what goes with it
#   BLW_BOARD          a folder-less name: the linker script port/cortex_m/<board>.ld
#   BLW_QEMU_MACHINE   the machine of qemu-system-arm with that core and that memory
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(BLW_LINK_OPTIONS --specs=nano.specs)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # there is no start-up code yet
set(BLW_TOOL_PREFIX arm-none-eabi-)
set(BLW_START_UP cortex_m)
foreach(language C CXX ASM)
  set(CMAKE_${language}_FLAGS_INIT "${BLW_CPU_FLAGS} -mthumb -ffunction-sections -fdata-sections")
endforeach()
set(CMAKE_CROSSCOMPILING_EMULATOR
    ${CMAKE_CURRENT_LIST_DIR}/../qemu.sh qemu-system-arm ${BLW_QEMU_MACHINE})
