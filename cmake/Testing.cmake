# SPDX-License-Identifier: Apache-2.0
# Code shared by tests, in folders testing/ of the first library. Tests of a module may use it from the modules below it.
file(GLOB_RECURSE shared CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/*.cc)
list(FILTER shared INCLUDE REGEX "/testing/[^/]*\\.cc$")
add_library(mjsense_testing STATIC ${shared})
target_link_libraries(mjsense_testing PRIVATE mjsense ${MJSENSE_PRIVATE_LIBS})

# Program that writes recordings without physics, for the Python tests and for bench/record.py.
add_executable(record_fake ${PROJECT_SOURCE_DIR}/tests/record/fake_writer.cc ${PROJECT_SOURCE_DIR}/tests/record/kill_at.cc)
target_link_libraries(record_fake PRIVATE mjsense_testing mjsense ${MJSENSE_PRIVATE_LIBS} ${CMAKE_DL_LIBS})
