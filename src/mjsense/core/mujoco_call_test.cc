// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/mujoco_call.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/memory_limit.h"

namespace mjsense {
namespace {

using ::testing::HasSubstr;

TEST(MujocoCall, ReturnsTheResult) {
  EXPECT_EQ(call_mujoco(mju_springDamper, 1, 0, 0, 1, 0), mju_springDamper(1, 0, 0, 1, 0));
}

TEST(MujocoCall, AnErrorOfMujocoIsThrown) {
  EXPECT_EQ(error_of([] { run_mujoco([](void*) { mju_error("no %s", "memory"); }, nullptr); }),
            "no memory");
  // Nested calls fail alone, and a call after a failure works.
  EXPECT_EQ(error_of([] {
              const auto inner = [](void*) { mju_error("inner"); };
              EXPECT_EQ(error_of([&] { run_mujoco(inner, nullptr); }), "inner");
              run_mujoco([](void*) { mju_error("outer"); }, nullptr);
            }),
            "outer");
}

TEST(MujocoCall, NonErrorMessagesReachTheHandlerOfTheProcess) {
  static std::string seen;
  const mjfLogHandler previous =
      mju_setLogHandler([](const mjLogMessage* message) { seen = message->subject; });
  run_mujoco([](void*) { mju_warning("careful"); }, nullptr);
  mju_setLogHandler(previous);
  EXPECT_THAT(seen, HasSubstr("careful"));
}

// libmujoco's C++ code throws std::bad_alloc with its own run-time library.
TEST(MujocoCall, AnExceptionOfMujocoIsThrown) {
  const char* xml =
      "<mujoco><size nuser_geom='2000000000'/><worldbody><body><freejoint/><geom "
      "size='1'/></body></worldbody></mujoco>";
  testing::with_address_space(3'000'000'000, [&] {
    for (int i = 0; i < 3; ++i) {
      mjSpec* spec = mj_parseXMLString(xml, nullptr, nullptr, 0);
      ASSERT_NE(spec, nullptr);
      EXPECT_THAT(error_of([&] { call_mujoco(mj_compile, spec, nullptr); }),
                  HasSubstr("ran out of memory"));
      mj_deleteSpec(spec);
    }
  });
}

}  // namespace
}  // namespace mjsense
