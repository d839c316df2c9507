// SPDX-License-Identifier: Apache-2.0
#pragma once
// Fixture for tests that must hold for the kernels of every instruction set:
//   class Mine : public testing::EveryKernel {};
//   INSTANTIATE_TEST_SUITE_P(Isas, Mine, testing::every_isa(), testing::isa_of);

#include <gtest/gtest.h>

#include <string>

#include "mjsense/core/system/cpu.h"

namespace mjsense::testing {

class EveryKernel : public ::testing::TestWithParam<Isa> {
 protected:
  void SetUp() override {
    if (isa() > cpu_isa()) GTEST_SKIP() << "not on this CPU";
  }
  Isa isa() const { return GetParam(); }
};

inline auto every_isa() { return ::testing::Values(Isa::kPortable, Isa::kAvx2, Isa::kAvx512); }
inline std::string isa_of(const ::testing::TestParamInfo<Isa>& info) {
  return std::string(isa_name(info.param));
}

}  // namespace mjsense::testing
