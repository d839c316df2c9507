# SPDX-License-Identifier: Apache-2.0
# One benchmark program, made of the x_bench.cc beside the code.
find_package(benchmark REQUIRED)
find_package(ompl QUIET)  # a peer: apt-get install libompl-dev
file(GLOB_RECURSE benches CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mjsense/*_bench.cc)
if(benches)
  add_executable(mjsense_bench ${benches})
  target_link_libraries(mjsense_bench PRIVATE mjsense ${MJSENSE_PRIVATE_LIBS} benchmark::benchmark benchmark::benchmark_main)
  if(OMPL_FOUND)
    target_compile_definitions(mjsense_bench PRIVATE MJSENSE_BENCH_OMPL)
    target_include_directories(mjsense_bench SYSTEM PRIVATE ${OMPL_INCLUDE_DIRS})
    list(GET OMPL_LIBRARIES 0 ompl)  # the others' headers are not installed with it
    target_link_libraries(mjsense_bench PRIVATE ${ompl})
  endif()
endif()
