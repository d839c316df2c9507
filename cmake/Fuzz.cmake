# SPDX-License-Identifier: Apache-2.0
# Fuzz targets (libFuzzer, part of clang) for the readers of untrusted files, built with sanitizers. ./dev fuzz runs them.
# They need few modules; the rest of the library is not built for them.
if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "MJSENSE_FUZZ needs clang: cmake --preset fuzz")
endif()
set(MJSENSE_FUZZ_SOURCES ${MJSENSE_SOURCES})
list(FILTER MJSENSE_FUZZ_SOURCES INCLUDE REGEX "/mjsense/(core|hdf5|record|replay)/|/lidar/npy\\.cc$")
list(FILTER MJSENSE_FUZZ_SOURCES EXCLUDE REGEX "/(in_child|embedded)\\.cc$")
set(flags -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
add_library(mjsense_fuzzed STATIC EXCLUDE_FROM_ALL ${MJSENSE_FUZZ_SOURCES} tests/fuzz/in_process.cc)
target_compile_options(mjsense_fuzzed PUBLIC ${flags} PRIVATE -fsanitize=fuzzer-no-link)
target_link_options(mjsense_fuzzed PUBLIC ${flags})
target_include_directories(mjsense_fuzzed PUBLIC src ${PROJECT_SOURCE_DIR})
target_link_libraries(mjsense_fuzzed PUBLIC mujoco::mujoco ${MJSENSE_ALL_LIBS})

set_source_files_properties(src/mjsense/core/fields/toml_value.cc PROPERTIES
                            COMPILE_OPTIONS -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/tests/fuzz/ignored.txt)

add_custom_target(fuzz)
file(GLOB targets CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/fuzz/*_fuzz.cc)
foreach(source IN LISTS targets)
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} EXCLUDE_FROM_ALL ${source})
  target_compile_options(${name} PRIVATE -fsanitize=fuzzer)
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  target_link_libraries(${name} PRIVATE mjsense_fuzzed)
  add_dependencies(fuzz ${name})
endforeach()

# The recorder without physics, with the same sanitizers. Its readers run in a separate process. Used by tests/faults.
add_executable(record_fake EXCLUDE_FROM_ALL tests/record/fake_writer.cc src/mjsense/record/testing/fake_suite.cc src/mjsense/hdf5/child_reader.cc)
target_link_libraries(record_fake PRIVATE mjsense_fuzzed)
add_dependencies(fuzz record_fake)
