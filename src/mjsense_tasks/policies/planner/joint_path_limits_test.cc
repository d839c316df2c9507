// SPDX-License-Identifier: Apache-2.0
// Motion quality of every task with every kind of robot: commands stay within the robot's limits,
// also after failures, and the robot touches nothing that it should not.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/policies/planner/testing/motion_quality.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks::policies {
namespace {

struct Case {
  const char *task, *robot, *scene;
  int episodes, first = 0;
  // m, maximum penetration of a contact of the robot in an undisturbed episode
  double depth = 0.001;
  std::uint64_t seed = 0;
};
std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.task << " " << c.robot << " " << c.scene;
}

// Limits of an FR3: 10 rad/s^2, 2.62 rad/s. Published limits are higher.
constexpr double kAcceleration = 10, kSpeed = 2.62;
// Limits of bases, which drive with held objects: m/s^2, rad/s^2.
constexpr double kBase = 3.0, kBaseTurn = 10;
constexpr double kBaseSpeed = 0.6, kBaseTurnSpeed = 1.5;  // m/s, rad/s
// Floating hands return to their path slightly faster.
constexpr double kHandSpeed = 0.7, kHandTurnSpeed = 1.8;

int number(const char* name, int otherwise) {
  const char* value = std::getenv(name);
  return value ? std::atoi(value) : otherwise;
}

struct Stage {
  Stage(const Case& c, double perturb, bool noise) {
    episode::TaskCfg cfg = episode::task_cfg(c.robot, c.scene);
    rollout::set_task_defaults(c.task, cfg);
    cfg.action_noise = noise;
    cfg.perturb = perturb;
    cfg.seed = c.seed;
    task = rollout::make_task(c.task, cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), 1);
    policy = rollout::make_policy("planner");
    task->register_policy(*policy);
    data.reset(mj_makeData(scene->model()));
  }
  EpisodeResult run(std::int64_t episode, MotionQuality& quality) {
    return run_episode(
        *task, *policy, data.get(), 0, episode,
        [&](const World& world) { quality.look(world, task->last_action(0), planner().phase(0)); },
        [&](const World& world) { quality.begin(world); });
  }
  // The maximum speed of an arm joint (rad/s) after any physics step, and its time.
  MotionQuality::Greatest executed_speed(std::int64_t episode, bool* success) {
    MotionQuality::Greatest speed;
    const EpisodeResult result =
        run_episode(*task, *policy, data.get(), 0, episode, {}, {}, [&](const World& world) {
          for (const robots::MoveGroup& group : task->robot().groups()) {
            if (group.kind != robots::GroupKind::kArm) continue;
            for (int dof : group.dofs)
              speed.see(std::abs(world.data->qvel[dof]), world.time(), planner().phase(0));
          }
        });
    *success = result.success;
    return speed;
  }
  const episode::PlannerPolicy& planner() const {
    return dynamic_cast<const episode::PlannerPolicy&>(*policy);
  }
  int retries() const { return planner().num_retries(0); }
  std::unique_ptr<episode::Task> task;
  std::unique_ptr<scene::Scene> scene;
  std::unique_ptr<episode::Policy> policy;
  DataPtr data;
};

std::string said(const Case& c, std::int64_t episode, const MotionQuality::Greatest& g) {
  std::ostringstream out;
  out << c << ", episode " << episode << " at " << g.at << " s in phase " << g.phase;
  return out.str();
}

class MotionLimits : public ::testing::TestWithParam<Case> {};

// MJSENSE_FIRST and MJSENSE_EPISODES select other episodes.
TEST_P(MotionLimits, CommandsStayWithinTheLimits) {
  const Case& c = GetParam();
  Stage stage(c, 0.5, /*noise=*/false);
  const int first = number("MJSENSE_FIRST", c.first), many = number("MJSENSE_EPISODES", c.episodes);
  for (int episode = first; episode < first + many; ++episode) {
    MotionQuality q(stage.scene->model(), stage.task->robot());
    const EpisodeResult result = stage.run(episode, q);
    const auto below = [&](const MotionQuality::Greatest& g, double maximum, const char* what) {
      EXPECT_LE(g.value, maximum * (1 + 1e-9)) << what << " of " << said(c, episode, g);
    };
    below(q.joint_speed, kSpeed, "speed of a joint");
    below(q.joint_acceleration, kAcceleration, "acceleration of a joint");
    const bool drives = scenes::driving_base(stage.task->robot()) >= 0;
    below(q.base_speed, drives ? kBaseSpeed : kHandSpeed, "speed of the base");
    below(q.base_turn, drives ? kBaseTurnSpeed : kHandTurnSpeed, "angular speed of the base");
    below(q.base_acceleration, kBase, "acceleration of the base");
    below(q.base_turn_acceleration, kBaseTurn, "angular acceleration of the base");
    if (stage.task->perturbation(0).happened() || stage.retries() > 0) continue;
    EXPECT_LT(q.speed, kSpeed) << c << ", episode " << episode;
    EXPECT_LT(q.acceleration, kAcceleration)
        << q.accelerated << ", " << c << ", episode " << episode;
    EXPECT_LT(q.depth, c.depth) << q.deepest << ", " << c << ", episode " << episode;
    EXPECT_EQ(q.self_collisions, 0) << q.met << ", " << c << ", episode " << episode;
    if (std::getenv("MJSENSE_EPISODES"))
      printf(
          "%s %d: %s %d steps; %.2f rad/s2 told, %.2f done; base %.2f m/s, %.2f rad/s; %.2f mm, "
          "%s\n",
          ::testing::PrintToString(c).c_str(), episode, result.success ? "ok" : "FAIL",
          result.steps, q.joint_acceleration.value, q.acceleration, q.base_speed.value,
          q.base_turn.value, 1000 * q.depth, q.deepest.c_str());
  }
}

const std::vector<Case> kCases{
    // One episode for similar cases, unless they were found to differ.
    Case{"pick", "franka", "", 2}, Case{"pick", "franka", "table", 1},
    Case{"pick", "franka", "clutter", 3}, Case{"pick", "mobile_franka", "", 1},
    Case{"pick", "i2rt_yam", "", 2}, Case{"pick", "bimanual_yam", "", 1},
    Case{"pick", "floating_rum", "", 3}, Case{"pick", "rby1", "", 1},
    Case{"pick_and_place", "franka", "", 4}, Case{"pick_and_place", "mobile_franka", "", 1},
    Case{"pick_and_place", "i2rt_yam", "", 1}, Case{"pick_and_place", "bimanual_yam", "", 1},
    Case{"pick_and_place", "floating_rum", "", 2}, Case{"pick_and_place", "rby1", "", 2},
    Case{"pick_and_place_next_to", "franka", "", 3},
    Case{"pick_and_place_color", "franka", "", 2, 7}, Case{"packing", "franka", "", 3},
    Case{"open", "franka", "", 3}, Case{"open", "mobile_franka", "", 2},
    Case{"open", "i2rt_yam", "", 1}, Case{"open", "bimanual_yam", "", 1},
    Case{"open", "floating_rum", "", 3}, Case{"open", "rby1", "", 2},
    Case{"close", "franka", "", 2}, Case{"close", "mobile_franka", "", 1},
    Case{"close", "i2rt_yam", "", 4}, Case{"close", "bimanual_yam", "", 1},
    Case{"close", "floating_rum", "", 2}, Case{"close", "rby1", "", 2},
    Case{"door_opening", "rby1", "", 2}, Case{"door_opening", "rby1", "room_with_door:2", 2},
    // Fingers that move a heavy door by its handle penetrate deeper.
    Case{"door_opening", "mobile_franka", "", 1, 0, 0.0015}, Case{"nav_to_obj", "rby1", "", 1},
    Case{"nav_to_obj", "mobile_franka", "", 1}};

std::string name_of_case(const ::testing::TestParamInfo<Case>& info) {
  std::string name = std::string(info.param.task) + "_" + info.param.robot;
  for (const char* c = info.param.scene; *c; ++c) {
    if (c == info.param.scene) name += "_";
    name += std::isalnum(*c) ? *c : char{'_'};
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Tasks, MotionLimits, ::testing::ValuesIn(kCases), name_of_case);

class NoisyMotion : public ::testing::TestWithParam<Case> {};

// With action noise the executed motion stays below the speed limit, also near singular postures.
// MJSENSE_EPISODES=65 runs that many episodes of each task and robot, from MJSENSE_FIRST on.
TEST_P(NoisyMotion, StaysBelowTheJointSpeedLimit) {
  const Case& c = GetParam();
  const int first = number("MJSENSE_FIRST", c.first), many = number("MJSENSE_EPISODES", c.episodes);
  Stage stage(c, 0, /*noise=*/true);
  for (int episode = first; episode < first + many; ++episode) {
    bool success;
    const MotionQuality::Greatest speed = stage.executed_speed(episode, &success);
    EXPECT_LE(speed.value, kSpeed) << said(c, episode, speed);
    if (std::getenv("MJSENSE_EPISODES")) {
      std::printf("noise %s %d: %s, %.3f of the limit\n", ::testing::PrintToString(c).c_str(),
                  episode, success ? "ok" : "FAIL", speed.value / kSpeed);
      std::fflush(stdout);
    }
  }
}

// Each pair of task and robot once; only if MJSENSE_EPISODES is set.
std::vector<Case> noisy_cases() {
  std::vector<Case> cases;
  for (const Case& c : kCases) {
    const bool known = std::ranges::any_of(cases, [&](const Case& other) {
      return std::string_view(other.task) == c.task && std::string_view(other.robot) == c.robot;
    });
    if (!known && std::getenv("MJSENSE_EPISODES")) cases.push_back({c.task, c.robot, "", 0});
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(
    Singular, NoisyMotion,
    ::testing::Values(
        Case{.task = "pick_and_place",
             .robot = "bimanual_yam",
             .scene = "",
             .episodes = 1,
             .first = 7,
             .seed = 771000},
        Case{.task = "pick_and_place", .robot = "rby1", .scene = "", .episodes = 1, .first = 11}),
    name_of_case);
INSTANTIATE_TEST_SUITE_P(Tasks, NoisyMotion, ::testing::ValuesIn(noisy_cases()), name_of_case);

}  // namespace
}  // namespace mjsense::tasks::policies
