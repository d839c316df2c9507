// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"

namespace mjsense::tasks::rollout {
namespace {

using ::testing::HasSubstr;

template <class Make>
void expect_unknown(Make&& make, const char* nearest) {
  EXPECT_THAT(error_of<KeyError>([&] { make(); }), HasSubstr(nearest));
}

TEST(Registry, CreatesEveryNamedTaskAndPolicy) {
  for (const std::string& robot : robots::robot_names()) {
    for (const std::string& task : task_names()) {
      episode::TaskCfg cfg;
      cfg.robot = robots::robot_cfg(robot);
      EXPECT_EQ(cfg.robot.name, robot);
      EXPECT_EQ(make_task(task, cfg)->name(), task);
    }
  }
  for (const std::string& policy : policy_names()) EXPECT_EQ(make_policy(policy)->name(), policy);
}

TEST(Registry, UnknownNamesThrowWithTheNearest) {
  expect_unknown([] { robots::robot_cfg("frnka"); }, "did you mean 'franka'?");
  expect_unknown([] { make_task("pik", {}); }, "did you mean 'pick'?");
  expect_unknown([] { make_policy("plannr"); }, "did you mean 'planner'?");
}

}  // namespace
}  // namespace mjsense::tasks::rollout
