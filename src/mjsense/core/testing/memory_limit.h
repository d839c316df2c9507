// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tests that run out of memory.

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>

namespace mjsense::testing {

// Emulators ignore this limit, because it would be theirs too.
inline bool address_space_can_be_limited() {
  rlimit before, now;
  getrlimit(RLIMIT_AS, &before);
  const rlimit other{rlim_t(1) << 46, before.rlim_max};
  setrlimit(RLIMIT_AS, &other);
  getrlimit(RLIMIT_AS, &now);
  setrlimit(RLIMIT_AS, &before);
  return now.rlim_cur == other.rlim_cur;
}

// Runs `test` in a child process with this address space (bytes); failures there fail the calling
// test. With sanitisers the test is skipped, because they reserve terabytes.
inline void with_address_space(rlim_t bytes, auto&& test) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "an address space of " << bytes << " bytes is too small for a sanitiser";
#endif
  if (!address_space_can_be_limited()) GTEST_SKIP() << "an emulator ignores the limit";
  const auto child = [&] {
    const rlimit limit{bytes, bytes};
    setrlimit(RLIMIT_AS, &limit);
    test();
    std::_Exit(::testing::Test::HasFailure() ? 1 : 0);
  };
  EXPECT_EXIT(child(), ::testing::ExitedWithCode(0), "");
}

}  // namespace mjsense::testing
