# SPDX-License-Identifier: Apache-2.0
# Checks that every header compiles without other includes: ninja headers_alone. A source file that includes only this header is
# generated for each header that is not the first include of an x.cc in the same folder (tools/check_rooms.py).
file(GLOB_RECURSE headers RELATIVE ${PROJECT_SOURCE_DIR}/src CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*.h)
if(NOT MJSENSE_OPENGL)
  list(FILTER headers EXCLUDE REGEX "/opengl/")
endif()
set(sources)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "h$" "cc" own ${PROJECT_SOURCE_DIR}/src/${header})
  if(EXISTS ${own})
    continue()
  endif()
  set(source ${PROJECT_BINARY_DIR}/headers_alone/${header}.cc)
  file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n")
  list(APPEND sources ${source})
endforeach()
add_library(headers_alone OBJECT EXCLUDE_FROM_ALL ${sources})
target_link_libraries(headers_alone PRIVATE mjsense_tasks ${MJSENSE_ALL_LIBS} GTest::gtest GTest::gmock)
target_compile_options(headers_alone PRIVATE -O0 -Wall -Wextra -Wno-missing-field-initializers -Wno-unused-function
                                             -Wno-unused-variable)
