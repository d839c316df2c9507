# SPDX-License-Identifier: Apache-2.0
# Instruction sets. The library runs on any x86-64. Files named *_avx2.cc and *_avx512.cc are compiled for these and chosen at
# run time (core/system/cpu.h), so that no CPU executes an instruction that it does not support. On AArch64 these files are left out.
# GCC 12 warns of uninitialised values inside its own AVX-512 headers. At -O3 its vectorizer for straight-line code drops the
# rounding of double(float(x)); it is disabled, because the kernels are already written with vectors.
# GCC copies structures 16 bytes at a time; a vector of 32 or 64 that is read right after such a copy has to wait until all parts
# have left the store buffer. Effect of copies as wide as the vectors: depth of the moving Panda 4.1 -> 2.4 ms, of the kitchen 6.1 -> 4.4,
# colors 14.2 -> 11.6 and 14.8 -> 12.8 (640 x 480, shortest of 21 with AVX2).
set(MJSENSE_ISAS portable)
if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND MJSENSE_ISAS avx2 avx512)
  list(APPEND MJSENSE_SOURCES ${PROJECT_SOURCE_DIR}/src/mjsense/core/call_in_frame_x86_64.S)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    set(quiet "-Wno-uninitialized;-Wno-maybe-uninitialized")
    if(CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 12)
      set(copies256 "-mmove-max=256;-mstore-max=256")
      set(copies512 "-mmove-max=512;-mstore-max=512")
    endif()
  endif()
  foreach(file IN LISTS MJSENSE_SOURCES)
    if(file MATCHES "_avx2\\.cc$")
      set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS "-march=x86-64-v3;-O3;-fno-tree-slp-vectorize;${copies256}")
    elseif(file MATCHES "_avx512\\.cc$")
      set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS
                                  "-march=x86-64-v4;-mprefer-vector-width=512;-O3;-fno-tree-slp-vectorize;${copies512};${quiet}")
    endif()
  endforeach()
elseif(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
  list(FILTER MJSENSE_SOURCES EXCLUDE REGEX "_avx(2|512)\\.cc$")
  list(APPEND MJSENSE_SOURCES ${PROJECT_SOURCE_DIR}/src/mjsense/core/call_in_frame_aarch64.S)
  # As on x86-64 without FMA: products are rounded before they are added, and char is signed.
  add_compile_options(-ffp-contract=off -fsigned-char)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    add_compile_options(-Wno-psabi)  # notes that GCC 9 passed structs of vectors differently
  endif()
else()
  message(FATAL_ERROR "mjsense supports Linux on x86-64 and AArch64 (docs/install.md); this is ${CMAKE_SYSTEM_NAME} on ${CMAKE_SYSTEM_PROCESSOR}")
endif()
