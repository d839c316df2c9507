# SPDX-License-Identifier: Apache-2.0
# One benchmark program, built from all x_bench.cc files in the source folders.
find_package(benchmark REQUIRED)
find_package(TBB REQUIRED)  # the peer of core/system/thread_pool.h
file(GLOB_RECURSE benches CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*_bench.cc)
if(benches)
  add_executable(mjsense_bench ${benches})
  target_link_libraries(mjsense_bench PRIVATE mjsense_tasks ${MJSENSE_ALL_LIBS} TBB::tbb benchmark::benchmark benchmark::benchmark_main)
endif()
