// SPDX-License-Identifier: Apache-2.0
#pragma once
// Instruction set of the CPU, for choosing among kernels that are compiled several times (files
// *_avx2.cc, *_avx512.cc).

#include <string_view>

namespace mjsense {

enum class Isa { kPortable, kAvx2, kAvx512 };  // x86-64 (or anything else), x86-64-v3, x86-64-v4

// The best instruction set of this CPU, determined once. The environment variable MJSENSE_ISA
// (portable, avx2, avx512) can lower it, for tests and for comparing machines. Requesting one that
// the CPU lacks is a RuntimeError.
Isa cpu_isa();
std::string_view isa_name(Isa isa);

}  // namespace mjsense
