// SPDX-License-Identifier: Apache-2.0
#pragma once
// Instruction set of the CPU, for choosing among kernels that are compiled several times (files
// *_avx2.cc, *_avx512.cc), and what else differs between x86-64 and AArch64.

#include <string_view>

namespace mjsense {

// x86-64 or AArch64, x86-64-v3, x86-64-v4
enum class Isa { kPortable, kAvx2, kAvx512 };

#if defined(__x86_64__)
constexpr bool kHasAvx = true;
// For functions with simple loops, which are then compiled for wide vectors too. Without fused
// operations, so that the results are the same.
#define MJSENSE_WIDE_TOO [[gnu::target_clones("avx2", "default")]]
inline void spin_pause() { __builtin_ia32_pause(); }
#else
constexpr bool kHasAvx = false;  // kernels for AVX are declared but not compiled (cmake/Isa.cmake)
#define MJSENSE_WIDE_TOO
inline void spin_pause() { asm volatile("isb"); }  // `yield` does nothing on most AArch64
#endif

// The best instruction set of this CPU, and the one in use, both determined once. The environment
// variable MJSENSE_ISA (portable, avx2, avx512) can lower the latter, for tests and for comparing
// machines. Requesting one that the CPU lacks is a RuntimeError.
Isa best_isa();
Isa cpu_isa();
std::string_view isa_name(Isa isa);

}  // namespace mjsense
