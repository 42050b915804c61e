# SPDX-License-Identifier: MIT
# The test framework Unity as the target blw_unity: an installed one, else the three source files
# in BLW_UNITY_DIR (tools/bulwark puts them there), else upstream's at a pinned tag.
set(BLW_UNITY_DIR "${PROJECT_SOURCE_DIR}/build/unity" CACHE PATH "Folder of unity.c and unity.h")

function(blw_unity_from directory)
  add_library(blw_unity STATIC ${directory}/unity.c)
  target_include_directories(blw_unity SYSTEM PUBLIC ${directory})
  target_compile_definitions(blw_unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
  if(CMAKE_CROSSCOMPILING) # to the host's console; no stdio, which a small target cannot hold
    target_compile_definitions(blw_unity PUBLIC
      UNITY_OUTPUT_CHAR=host_io_putc "UNITY_OUTPUT_CHAR_HEADER_DECLARATION=host_io_putc(int)")
  endif()
endfunction()

find_package(unity QUIET)
if(TARGET unity::framework)
  add_library(blw_unity INTERFACE)
  target_link_libraries(blw_unity INTERFACE unity::framework)
  target_compile_definitions(blw_unity INTERFACE UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
elseif(EXISTS "${BLW_UNITY_DIR}/unity.c")
  blw_unity_from("${BLW_UNITY_DIR}")
else()
  include(FetchContent)
  FetchContent_Declare(unity_source
    GIT_REPOSITORY https://github.com/ThrowTheSwitch/Unity.git
    GIT_TAG        v2.6.0
    GIT_SHALLOW    TRUE
    SOURCE_SUBDIR  none) # only the files; its CMake project is not needed
  FetchContent_MakeAvailable(unity_source)
  blw_unity_from("${unity_source_SOURCE_DIR}/src")
endif()
