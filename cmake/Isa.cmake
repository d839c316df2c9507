# SPDX-License-Identifier: Apache-2.0
# Instruction sets. The library runs on any x86-64. Files named *_avx2.cc and *_avx512.cc are compiled for these and chosen at
# run time (core/cpu.h), so that a machine without them never meets an illegal instruction.
# GCC 12 warns of uninitialised values inside its own AVX-512 headers. What it vectorises in straight lines at -O3 loses the
# rounding of double(float(x)); kernels are vectors already.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    set(quiet "-Wno-uninitialized;-Wno-maybe-uninitialized")
  endif()
  foreach(file IN LISTS MJSENSE_SOURCES)
    if(file MATCHES "_avx2\\.cc$")
      set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS "-march=x86-64-v3;-O3;-fno-tree-slp-vectorize")
    elseif(file MATCHES "_avx512\\.cc$")
      set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS
                                  "-march=x86-64-v4;-mprefer-vector-width=512;-O3;-fno-tree-slp-vectorize;${quiet}")
    endif()
  endforeach()
endif()
