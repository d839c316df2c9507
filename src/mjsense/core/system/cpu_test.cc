// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/cpu.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

[[noreturn]] void print_isa() {
  try {
    std::fputs(std::string(isa_name(cpu_isa())).c_str(), stderr);
  } catch (const Error& e) {
    std::fputs(e.what(), stderr);
  }
  std::exit(0);
}

// The instruction set is determined once in a process: a new process of this program prints it.
TEST(Cpu, TheEnvironmentLowersTheInstructionSet) {
  const char* before = std::getenv("MJSENSE_ISA");
  const std::string restored = before ? before : "";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  for (const auto& [wanted, printed] :
       {std::pair{"portable", "^portable$"}, {"sse", "expected portable, avx2 or avx512"}}) {
    setenv("MJSENSE_ISA", wanted, 1);
    EXPECT_EXIT(print_isa(), ::testing::ExitedWithCode(0), printed);
  }
  setenv("MJSENSE_ISA", restored.c_str(), 1);
}

}  // namespace
}  // namespace mjsense
