# SPDX-License-Identifier: MIT
# What the toolchain files of all RISC-V targets share.  The including file has set
#   BLW_CPU_FLAGS  -march and -mabi
#   BLW_QEMU       the QEMU of that register width
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv)
set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_CXX_COMPILER riscv64-unknown-elf-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY) # there is no start-up code yet
set(BLW_TOOL_PREFIX riscv64-unknown-elf-)
set(BLW_START_UP riscv)
set(BLW_BOARD virt)
set(BLW_LINK_OPTIONS -lc -lgcc)
foreach(language C CXX ASM)
  set(CMAKE_${language}_FLAGS_INIT "${BLW_CPU_FLAGS} -mcmodel=medany --specs=picolibc.specs \
-ffunction-sections -fdata-sections")
endforeach()
set(CMAKE_CROSSCOMPILING_EMULATOR ${CMAKE_CURRENT_LIST_DIR}/../qemu.sh ${BLW_QEMU} virt)
