// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/task_defaults.h"

#include <gtest/gtest.h>

#include "mjsense_tasks/episode/testing/played_task.h"

namespace mjsense::tasks::rollout {
namespace {

int horizon(const char* task, const char* robot) {
  episode::TaskCfg cfg = episode::task_cfg(robot, "");
  set_task_defaults(task, cfg);
  return cfg.horizon;
}

TEST(TaskDefaults, HorizonsEqualMolmoSpaces) {
  EXPECT_EQ(horizon("pick", "franka"), 500);
  EXPECT_EQ(horizon("pick_and_place", "franka"), 500);
  EXPECT_EQ(horizon("pick", "rby1"), 400);
  for (const char* robot : {"franka", "rby1"}) {
    EXPECT_EQ(horizon("open", robot), 200) << robot;
    EXPECT_EQ(horizon("close", robot), 200) << robot;
  }
  EXPECT_EQ(horizon("door_opening", "rby1"), 400);
  EXPECT_EQ(horizon("nav_to_obj", "rby1"), 500);
}

}  // namespace
}  // namespace mjsense::tasks::rollout
