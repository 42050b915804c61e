# SPDX-License-Identifier: MIT
# Install the library into an empty folder (WAY=find_package) or not (WAY=add_subdirectory), build
# the consumer against it from scratch and run it as C and as C++.
file(REMOVE_RECURSE "${WORK}")
set(tools -G "${GENERATOR}" -D CMAKE_C_COMPILER=${CC} -D CMAKE_CXX_COMPILER=${CXX}
          -D CMAKE_BUILD_TYPE=Release)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

if(WAY STREQUAL "find_package")
  run(${CMAKE_COMMAND} -S ${LIB} -B ${WORK}/lib ${tools} -D BLW_DOUBLE=${BLW_DOUBLE}
      -D CMAKE_INSTALL_PREFIX=${WORK}/prefix)
  run(${CMAKE_COMMAND} --build ${WORK}/lib --target install)
  set(where -D CMAKE_PREFIX_PATH=${WORK}/prefix)
else()
  set(where -D BLW_SUBDIRECTORY=${LIB} -D BLW_DOUBLE=${BLW_DOUBLE})
endif()
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${WORK}/consumer ${tools} ${where})
run(${CMAKE_COMMAND} --build ${WORK}/consumer)
run(${WORK}/consumer/consumer_c)
run(${WORK}/consumer/consumer_cxx)
