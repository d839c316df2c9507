# SPDX-License-Identifier: Apache-2.0
# One test program per module, built from the x_test.cc files in its folder. ctest runs each program as one test. Programs of the first
# library are linked without the second.
find_package(GTest REQUIRED)
# Under an emulator the slowest tests are left out (tests/emulated.txt).
if(CMAKE_CROSSCOMPILING)
  file(STRINGS ${PROJECT_SOURCE_DIR}/tests/emulated.txt MJSENSE_LEFT_OUT REGEX "^without ")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/emulated.txt)
endif()
file(GLOB MJSENSE_ROOMS CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/* ${PROJECT_SOURCE_DIR}/src/mjsense_tasks/*)
foreach(folder IN LISTS MJSENSE_ROOMS)
  get_filename_component(room ${folder} NAME)
  file(GLOB_RECURSE tests CONFIGURE_DEPENDS ${folder}/*_test.cc)
  if(NOT MJSENSE_OPENGL)
    list(FILTER tests EXCLUDE REGEX "/opengl/")
  endif()
  if(tests)
    add_executable(${room}_test ${tests})
    mjsense_unity(${room}_test 4 ${tests})
    if(folder MATCHES "/mjsense_tasks/")
      set(library mjsense_tasks ${MJSENSE_ALL_LIBS})
    else()
      set(library mjsense ${MJSENSE_PRIVATE_LIBS})
    endif()
    target_link_libraries(${room}_test PRIVATE mjsense_testing ${library} GTest::gtest GTest::gmock GTest::gtest_main)
    target_compile_options(${room}_test PRIVATE -Wall -Wextra -Wno-missing-field-initializers
                           $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
    add_test(NAME ${room} COMMAND ${room}_test)
    if(CMAKE_CROSSCOMPILING)
      set_tests_properties(${room} PROPERTIES TIMEOUT 7200)  # s
    endif()
    set(left_out ${MJSENSE_LEFT_OUT})
    list(FILTER left_out INCLUDE REGEX "^without ${room} ")
    if(left_out)
      list(TRANSFORM left_out REPLACE "^without [^ ]+ ([^ ]+).*" "\\1")
      list(JOIN left_out ":" left_out)
      set_tests_properties(${room} PROPERTIES ENVIRONMENT "GTEST_FILTER=-${left_out}")
    endif()
  endif()
endforeach()

# The longest program is started first, so that the others run at the same time.
if(TARGET policies_test)
  set_tests_properties(policies PROPERTIES COST 1000)
endif()

# Tests of the kernels as on a CPU without wide vectors.
if("avx2" IN_LIST MJSENSE_ISAS)
  foreach(room rays render)
    add_test(NAME ${room}_portable COMMAND ${room}_test)
    set_tests_properties(${room}_portable PROPERTIES ENVIRONMENT MJSENSE_ISA=portable)
  endforeach()
endif()

# Golden tests of exact results (tests/golden), once for each instruction set that the kernels are compiled for. Results depend on
# the optimization level and on the compiler.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize" AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  set(MJSENSE_GOLDEN_FILE ${PROJECT_SOURCE_DIR}/tests/golden/hashes.txt)
  add_executable(golden_test tests/golden/golden_test.cc)
  target_link_libraries(golden_test PRIVATE mjsense_tasks ${MJSENSE_ALL_LIBS})
  target_compile_definitions(golden_test PRIVATE MJSENSE_GOLDEN_FILE="${MJSENSE_GOLDEN_FILE}")
  target_compile_options(golden_test PRIVATE -Wall -Wextra -Wno-missing-field-initializers)
  foreach(isa IN LISTS MJSENSE_ISAS)
    add_test(NAME golden_${isa} COMMAND golden_test)
    set_tests_properties(golden_${isa} PROPERTIES ENVIRONMENT MJSENSE_ISA=${isa} SKIP_RETURN_CODE 77)
  endforeach()
endif()
