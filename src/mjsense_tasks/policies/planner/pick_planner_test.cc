// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/pick_planner.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::policies {
namespace {

struct Stage {
  explicit Stage(int num_worlds, bool noise = false) {
    episode::TaskCfg cfg;
    cfg.robot = robots::robot_cfg("franka");
    cfg.scene = "table";
    cfg.action_noise = noise;
    task = std::make_unique<tasks::PickTask>(cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), num_worlds);
    policy = std::make_unique<PickPlanner>();
    task->register_policy(*policy);
    for (int w = 0; w < num_worlds; ++w) data.emplace_back(mj_makeData(scene->model()));
  }
  std::unique_ptr<episode::Task> task;
  std::unique_ptr<scene::Scene> scene;
  std::unique_ptr<episode::Policy> policy;
  std::vector<DataPtr> data;
};

TEST(PickPlanner, PicksUpMostObjects) {
  const char* wanted = std::getenv("MJSENSE_PICK_EPISODES");
  const int episodes = wanted ? std::atoi(wanted) : 10;
  const bool noise = std::getenv("MJSENSE_PICK_NOISE") != nullptr;
  Stage stage(2, noise);
  std::vector<EpisodeResult> results(episodes);
  std::vector<std::string> text(episodes);
  ThreadPool pool(2);
  pool.run(episodes, [&](int e, int w) {
    results[e] = run_episode(*stage.task, *stage.policy, stage.data[w].get(), w, e);
    text[e] = stage.task->description(w) + " retries " +
              std::to_string(static_cast<episode::PlannerPolicy&>(*stage.policy).num_retries(w));
  });
  int successes = 0;
  for (int e = 0; e < episodes; ++e) {
    const EpisodeResult& r = results[e];
    successes += r.success;
    EXPECT_FALSE(r.success && r.truncated)
        << text[e] << ": the planner must end the episode itself";
    if (wanted)
      printf("%3d %-32s steps %3d success %d gave_up %d truncated %d reward %.4f\n", e,
             text[e].c_str(), r.steps, r.success, r.gave_up, r.truncated, r.reward);
  }
  RecordProperty("successes", successes);
  if (wanted) printf("%d of %d\n", successes, episodes);
  EXPECT_GE(successes, 0.9 * episodes);
}

TEST(PickPlanner, AnEpisodeIsTheSameInEveryWorld) {
  Stage stage(3, /*noise=*/true);
  run_episode(*stage.task, *stage.policy, stage.data[0].get(), 0, 4);
  // must not affect the next episode
  run_episode(*stage.task, *stage.policy, stage.data[2].get(), 2, 8);
  run_episode(*stage.task, *stage.policy, stage.data[2].get(), 2, 4);
  const int nq = stage.scene->model()->nq;
  EXPECT_EQ(0, std::memcmp(stage.data[0]->qpos, stage.data[2]->qpos, nq * sizeof(double)));
}

// A world whose target is moved after sampling.
struct Moved {
  Moved(Stage& stage, double x, double y)
      : world{.id = 0, .model = stage.scene->model(), .data = stage.data[0].get()} {
    stage.task->sample(0, 0, robots::state_row(world.data));
    mj_forward(world.model, world.data);
    qpos = world.data->qpos +
           world.model->jnt_qposadr[world.model->body_jntadr[stage.task->objects(0)[0].body]];
    move(x, y);
    stage.task->begin(world);
    stage.policy->reset(world);
  }
  void move(double x, double y) {
    qpos[0] += x;
    qpos[1] += y;
    mj_forward(world.model, world.data);
  }
  World world;
  double* qpos;
};

// Another object is close to the target, on each side in turn. The chosen grasp must not collide
// with it or, before closing, with the target; and the path down must be free if a free one exists.
TEST(PickPlanner, ChoosesAGraspWithClearanceToNeighbours) {
  Stage stage(1);
  const auto& pick = static_cast<tasks::PickTask&>(*stage.task);
  const robots::Robot& robot = pick.robot();
  const mjModel* model = stage.scene->model();
  const GripperShape gripper(model, robot, robot.gripper());
  mjData* data = stage.data[0].get();
  int planned = 0;
  for (int episode = 0; episode < 4; ++episode) {
    for (int side = 0; side < 8; ++side) {
      World world{.id = 0, .model = model, .data = data};
      stage.task->sample(0, episode, robots::state_row(data));
      mj_forward(model, data);
      const auto objects = pick.all_objects();
      const int target = pick.target(0), other = target == 0 ? 1 : 0;
      const auto place_of = [&](int object) {
        return data->qpos + model->jnt_qposadr[model->body_jntadr[objects[object].body]];
      };
      const double a = side * M_PI / 4;
      const double gap = objects[target].shape.radius + objects[other].shape.radius + 0.002;
      place_of(other)[0] = place_of(target)[0] + gap * std::cos(a);
      place_of(other)[1] = place_of(target)[1] + gap * std::sin(a);
      mj_forward(model, data);
      stage.task->begin(world);
      stage.policy->reset(world);
      robots::Action action;
      stage.policy->act(world, action);
      if (action.done) continue;
      ++planned;
      const Pose grasp = static_cast<episode::PlannerPolicy&>(*stage.policy).grasp_pose(0);
      for (std::size_t i = 0; i < objects.size(); ++i) {
        const Pose object = body_pose(data, objects[i].body);
        EXPECT_FALSE(gripper.hits(grasp, object, objects[i].shape, 0.0))
            << objects[i].kind << " at " << objects[target].kind << ", side " << side;
      }
      EXPECT_GT(grasp.p.z - gripper.tip, pick.support_height(0) + 0.003)
          << "finger tips are above the table";
    }
  }
  EXPECT_GT(planned, 20);
}

TEST(PickPlanner, GivesUpIfTheObjectIsOutOfReach) {
  Stage stage(1);
  Moved moved(stage, 2.0, 0.0);
  robots::Action action;
  stage.policy->act(moved.world, action);
  EXPECT_TRUE(action.done);
  ASSERT_TRUE(action.success.has_value());
  EXPECT_FALSE(*action.success);
  for (const robots::GroupValues& group : action.commands.groups) EXPECT_FALSE(group.given);
}

TEST(PickPlanner, RetriesAfterClosingOnNothingThenGivesUp) {
  Stage stage(1);
  Moved moved(stage, 0.0, 0.0);
  auto& planner = static_cast<episode::PlannerPolicy&>(*stage.policy);
  World& world = moved.world;
  std::vector<int> phases;
  int max_retries = 0;
  double side = 1;
  for (int step = 0; step < 400; ++step) {
    robots::Action action;
    planner.act(world, action);
    if (phases.empty() || phases.back() != planner.phase(0)) phases.push_back(planner.phase(0));
    if (planner.num_retries(0) > max_retries) {
      max_retries = planner.num_retries(0);
      for (int g = 0; g < 3; ++g)
        EXPECT_EQ(action.commands[g].given, g == stage.task->robot().arm()) << "the arm stops";
    }
    if (action.done) {
      EXPECT_EQ(action.success, std::optional<bool>(false));
      EXPECT_EQ(max_retries, 3);
      EXPECT_EQ(planner.failure(0), "the hand held nothing");
      const std::vector<int> one{2, 3, 4, 5};
      EXPECT_EQ(std::vector<int>(phases.begin(), phases.begin() + 4), one);
      return;
    }
    stage.task->apply(world, action, robots::state_row(world.data));
    // The object moves away whenever the fingers are about to close.
    if (planner.phase(0) == 4 &&
        stage.task->robot().opening(world, stage.task->robot().gripper()) > 0.08) {
      moved.move(0, 0.15 * side);
      side = -side;
    }
    for (int i = 0; i < stage.task->decimation(); ++i) mj_step(world.model, world.data);
    mj_forward(world.model, world.data);
    world.substep += stage.task->decimation();
  }
  FAIL() << "never gave up; retries " << max_retries;
}

TEST(Grasp, ClosesOnOppositeFacesOfABox) {
  Stage stage(1);
  const robots::Robot& robot = stage.task->robot();
  const GripperShape gripper(stage.scene->model(), robot, robot.gripper());
  EXPECT_NEAR(gripper.tip, 0.019 + 0.005, 1e-3);
  const auto& objects = static_cast<tasks::PickTask&>(*stage.task).all_objects();
  const auto& block = objects[0];
  ASSERT_EQ(block.kind, "red_block");
  const double yaw = 0.4;
  const Pose object{{0.5, 0.1, 0.625}, axis_angle({0, 0, 1}, yaw)};
  const Pose tool{{0.5, 0.1, 0.9}, {0, 1, 0, 0}};
  const auto grasps = propose_grasps(gripper, block.shape, object, 0.6, tool);
  ASSERT_FALSE(grasps.empty());
  for (std::size_t i = 0; i < grasps.size(); ++i) {
    EXPECT_GE(grasps[i].cost, grasps[i > 0 ? i - 1 : 0].cost);
    EXPECT_FALSE(gripper.hits(grasps[i].pose, object, block.shape, 0.0));
    EXPECT_LT(rotate(grasps[i].pose.q, {0, 0, 1}).z, -0.999) << "the approach is vertical";
    EXPECT_GT(grasps[i].pose.p.z, 0.6 + gripper.tip) << "finger tips are above the table";
    // The closing direction is along one of the sides (0.044 or 0.070 m), not a diagonal.
    const Vec3 closing = rotate(conjugate(object.q), rotate(grasps[i].pose.q, {0, 1, 0}));
    EXPECT_GT(std::max(std::abs(closing.x), std::abs(closing.y)), std::cos(0.2));
  }
}

TEST(Grasp, ChecksAreCountedIfThereIsNoGrasp) {
  Stage stage(1);
  const robots::Robot& robot = stage.task->robot();
  GripperShape gripper(stage.scene->model(), robot, robot.gripper());
  const auto& block = static_cast<tasks::PickTask&>(*stage.task).all_objects()[0];
  GraspChecks checks;
  const auto grasps = grasps_all_around(gripper, block.shape, &checks);
  EXPECT_FALSE(grasps.empty());
  EXPECT_EQ(checks.candidates, static_cast<int>(grasps.size()) + checks.nothing_between +
                                   checks.too_wide + checks.no_faces + checks.in_object);
  gripper.max_opening = 0.008;  // less than both gaps to the pads and 4 mm
  checks = {};
  EXPECT_TRUE(grasps_all_around(gripper, block.shape, &checks).empty());
  EXPECT_GT(checks.too_wide, 1000);
  EXPECT_TRUE(
      text_of(checks, gripper)
          .starts_with(fmt::format(
              "0 grasps, of {} candidates: {} too wide for the gripper, whose max_opening is 8 mm",
              checks.candidates, checks.too_wide)))
      << text_of(checks, gripper);
}

}  // namespace
}  // namespace mjsense::tasks::policies
