// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/cpu.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdlib>

#include "mjsense/core/error.h"

// Files and arrays are read and written as they are in memory. mujoco_call.cc has assembly code.
static_assert(std::endian::native == std::endian::little && sizeof(void*) == 8,
              "mjsense supports little-endian 64-bit CPUs: x86-64 and AArch64");

namespace mjsense {
namespace {

constexpr std::array<std::string_view, 3> kNames = {"portable", "avx2", "avx512"};

Isa detect() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  // Tests the features that define x86-64-v4 and x86-64-v3, under names that every compiler knows.
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                  __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                  __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512vl");
  if (v4) return Isa::kAvx512;
  if (v3) return Isa::kAvx2;
#endif
  return Isa::kPortable;
}

Isa choose() {
  const Isa best = best_isa();
  const char* wanted = std::getenv("MJSENSE_ISA");
  if (wanted == nullptr || *wanted == '\0') return best;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] != wanted) continue;
    if (static_cast<Isa>(i) > best)
      throw RuntimeError(
          fmt::format("MJSENSE_ISA={}: this CPU supports only {}", wanted, isa_name(best)));
    return static_cast<Isa>(i);
  }
  throw ValueError(fmt::format("MJSENSE_ISA={}: expected portable, avx2 or avx512", wanted));
}

}  // namespace

Isa best_isa() {
  static const Isa isa = detect();
  return isa;
}

Isa cpu_isa() {
  static const Isa isa = choose();
  return isa;
}

std::string_view isa_name(Isa isa) { return kNames[static_cast<std::size_t>(isa)]; }

}  // namespace mjsense
