// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/navigation/nav_planner.h"

#include <gtest/gtest.h>

#include "mjsense/core/error.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::policies {
namespace {

episode::TaskCfg of(const char* robot) {
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg(robot);
  cfg.policy_dt_ms = 200;
  return cfg;
}

struct Driven : episode::PlayedTask<tasks::NavToObjTask> {
  explicit Driven(const char* robot) : PlayedTask(1, of(robot)) { task.register_policy(planner); }
  NavPlanner planner;
};

TEST(NavPlanner, ReachesAPoseThatSeesTheObjectWithoutContact) {
  for (const char* robot : {"rby1", "mobile_franka"}) {
    Driven d(robot);
    for (int episode = 0; episode < 2; ++episode) {
      const EpisodeResult result = run_episode(d.task, d.planner, d.data.get(), 0, episode);
      EXPECT_TRUE(result.success) << robot << " " << episode;
      EXPECT_FALSE(result.gave_up);
      EXPECT_GT(result.reward, 0.04);
      EXPECT_EQ(d.planner.phase(0), 0);
      const mjModel* m = d.scene.model();
      for (int c = 0; c < d.data->ncon; ++c) {
        const mjContact& contact = d.data->contact[c];
        const int a = m->body_rootid[m->geom_bodyid[contact.geom[0]]],
                  b = m->body_rootid[m->geom_bodyid[contact.geom[1]]];
        const int robot_root = m->body_rootid[d.task.robot().base_body()];
        EXPECT_EQ(a == robot_root, b == robot_root) << "the robot touches something";
      }
    }
  }
}

// The planner makes a new plan if the base is farther than `astray` (0.35 m) from its command.
TEST(NavPlanner, PlansAgainIfTheBaseIsFarFromItsCommand) {
  Driven d("rby1");
  d.start(0);
  d.planner.reset(d.world);
  robots::Action action;
  d.planner.act(d.world, action);
  d.task.apply(d.world, action, robots::state_row(d.data.get()));
  const robots::GroupValues& sent = d.task.robot().targets(0)[d.task.robot().group_index("base")];
  const auto& base = d.task.robot().group("base").qpos;
  for (const double push : {0.3, 0.4}) {
    d.data->qpos[base[0]] = sent.values[0] + push;
    d.data->qpos[base[1]] = sent.values[1];
    mj_forward(d.model, d.data.get());
    d.planner.act(d.world, action);
    EXPECT_EQ(d.planner.failure(0), push < 0.35 ? "" : "the motion deviated from the plan");
  }
}

TEST(NavPlanner, RejectsUnsupportedTasksAndRobots) {
  tasks::PickTask pick(of("mobile_franka"));
  scene::Scene scene(pick.scene_cfg_with_robot());
  pick.initialize(scene.model(), 1);
  NavPlanner planner;
  EXPECT_THROW(pick.register_policy(planner), ValueError);
  tasks::NavToObjTask task(of("franka"));
  scene::Scene floor(task.scene_cfg_with_robot());
  task.initialize(floor.model(), 1);
  NavPlanner other;
  EXPECT_THROW(task.register_policy(other), ValueError) << "the base is not mobile";
}

}  // namespace
}  // namespace mjsense::tasks::policies
