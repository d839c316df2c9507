// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/door_opening/door_opening.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/observe/suite.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/testing/played_task.h"

namespace mjsense::tasks {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Played : episode::PlayedTask<DoorOpeningTask> {
  explicit Played(const std::string& scene = "room_with_door")
      : PlayedTask(2, episode::task_cfg("rby1", scene)) {}
  double& position() { return data->qpos[model->jnt_qposadr[task.door(0).joint]]; }
  // Applies torques (N m) to the hinge (positive opens) and the lever (positive presses down) for
  // `seconds`.
  void turn(double hinge, double lever, double seconds) {
    const scenes::Door& door = task.door(0);
    const double sign = door.open > door.shut ? 1 : -1;
    for (int i = 0; i < seconds / model->opt.timestep; ++i) {
      data->qfrc_applied[model->jnt_dofadr[door.joint]] = sign * hinge;
      data->qfrc_applied[model->jnt_dofadr[door.handle_joint]] = lever;
      mj_step(model, data.get());
    }
    mj_forward(model, data.get());
  }
};

TEST(DoorOpening, LatchHoldsUntilTheLeverIsPressed) {
  for (const char* house : {"room_with_door:0", "room_with_door:2"}) {
    Played p(house);
    p.start(0);
    p.turn(60, 0, 0.8);
    EXPECT_LT(p.task.fraction(p.world), 0.01) << house;
    p.turn(0, 0, 0.3);
    p.turn(8, 3, 1.5);
    EXPECT_GT(p.task.fraction(p.world), 0.3) << house;
  }
}

TEST(DoorOpening, SuccessUsesTheCurrentFractionForBothHingeDirections) {
  int negative = 0;
  for (const char* house : {"room_with_door:0", "room_with_door:2"}) {
    Played p(house);
    p.start(3);
    const scenes::Door& door = p.task.door(0);
    negative += door.open < door.shut ? 1 : 0;
    EXPECT_FALSE(p.task.evaluate(p.world).success) << "shut, at the end of the range that is 0";
    for (const auto& [part, success] :
         {std::pair{0.66, false}, {0.68, true}, {1.0, true}, {0.3, false}}) {
      p.position() = door.shut + part * (door.open - door.shut);
      mj_forward(p.model, p.data.get());
      EXPECT_NEAR(p.task.fraction(p.world), part, 1e-12);
      const episode::Evaluation e = p.task.evaluate(p.world);
      EXPECT_EQ(e.success, success) << part << ": not latched";
      EXPECT_EQ(e.missing, success ? "" : "the door is not open far enough");
      EXPECT_EQ(e.reward, success ? 1 : 0);
    }
  }
  EXPECT_EQ(negative, 1) << "one of the two houses has its hinge on the other side";
}

TEST(DoorOpening, RobotStartsWithoutCollisionOnEitherSideOfTheDoor) {
  Played p;
  int pushes = 0;
  for (int episode = 0; episode < 30; ++episode) {
    p.start(episode);
    EXPECT_EQ(p.task.start_error(p.world), "");
    const Pose base = p.task.robot().base_pose(p.world);
    const Vec3 direction = scenes::opening_direction(p.model, p.data.get(), p.task.door(0));
    const double side =
        dot(base.p - scenes::leaf_middle(p.model, p.data.get(), p.task.door(0)), direction);
    EXPECT_EQ(p.task.push(0), side < 0) << episode;
    EXPECT_EQ(p.task.description(0), side < 0 ? "Push the door open" : "Pull the door open");
    EXPECT_GT(std::abs(side), 0.9);
    EXPECT_LT(std::abs(side), 2.6);
    pushes += side < 0 ? 1 : 0;
    for (int c = 0; c < p.data->ncon; ++c) EXPECT_GT(p.data->contact[c].dist, -2e-3) << episode;
  }
  EXPECT_GT(pushes, 5);
  EXPECT_LT(pushes, 25);
}

TEST(DoorOpening, DoorStateIsCurrent) {
  Played p;
  p.start(1);
  const auto sensor = door_state_sensor(p.task);
  SensorInit init;
  init.model = p.model;
  init.num_worlds = 2;
  sensor->initialize(init);
  const scenes::Door& door = p.task.door(0);
  for (const double part : {0.0, 0.4, 0.9}) {
    p.position() = door.shut + part * (door.open - door.shut);
    mj_forward(p.model, p.data.get());
    sensor->compute(p.world);
    const auto row = sensor->fields()[0].data.row<std::uint8_t>(0);
    const auto state =
        nlohmann::json::parse(std::string(reinterpret_cast<const char*>(row.data())));
    EXPECT_NEAR(state["opening_percentage"][0].get<double>(), part, 1e-9);
    EXPECT_NEAR(state["joint_angle"][0].get<double>(), p.position(), 1e-9);
    EXPECT_EQ(state["is_open"][0].get<bool>(), part > 0.67);
    // The handle rotates about the hinge, so its distance from the axis is constant.
    const Vec3 hinge{state["door_position"][0], state["door_position"][1],
                     state["door_position"][2]};
    const Vec3 handle{state["handle_position"][0], state["handle_position"][1],
                      state["handle_position"][2]};
    const int geom = p.model->body_geomadr[door.handle];
    EXPECT_NEAR(norm(handle - vec3(p.data->geom_xpos + 3 * geom)), 0, 1e-9);
    EXPECT_NEAR(std::hypot(handle.x - hinge.x, handle.y - hinge.y), std::hypot(0.9, 0.02), 0.15);
  }
}

TEST(DoorOpening, ObjectPosesAreMatricesInTheBaseFrame) {
  Played p;
  p.start(1);
  for (const std::shared_ptr<Sensor>& sensor : p.task.create_task_sensors()) {
    if (sensor->name() != "object_poses") continue;
    sensor->initialize({.model = p.model, .num_worlds = 2});
    sensor->compute(p.world);
    const auto row = sensor->fields()[0].data.row<std::uint8_t>(0);
    const auto poses =
        nlohmann::json::parse(std::string(reinterpret_cast<const char*>(row.data())));
    ASSERT_EQ(poses.size(), 2u);
    const Pose base = p.task.robot().base_pose(p.world);
    for (const auto& [name, body] :
         {std::pair{"door", p.task.door(0).body}, {"door_handle", p.task.door(0).handle}}) {
      const auto& matrix = poses[name];
      ASSERT_EQ(matrix.size(), 4u) << name;
      EXPECT_EQ(matrix[3], nlohmann::json({0, 0, 0, 1}));
      const Pose in_base = inverse(base) * body_pose(p.data.get(), body);
      const Vec3 axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(matrix[i][3].get<double>(), in_base.p[i], 1e-9) << name;
        for (int j = 0; j < 3; ++j)
          EXPECT_NEAR(matrix[i][j].get<double>(), rotate(in_base.q, axes[j])[i], 1e-9) << name;
      }
    }
    return;
  }
  FAIL() << "there is no sensor 'object_poses'";
}

// Door recordings have the tools' poses under their own names. Other sensors stay, in their order.
TEST(DoorOpening, TheSuiteHasEachToolPoseOnce) {
  Played p;
  observe::SensorSuite suite;
  suite.extend(p.task.robot().create_robot_sensors());
  suite.extend(p.task.create_task_sensors());
  p.task.edit_suite(suite);
  EXPECT_THAT(suite.names(), ElementsAre("door_state", "left_tcp_pose", "right_tcp_pose",
                                         "grasp_state_door_handle", "object_poses"));
}

TEST(DoorOpening, SceneWithoutADoorIsRejected) {
  DoorOpeningTask task(episode::task_cfg("rby1", "table"));
  scene::Scene scene(task.scene_cfg_with_robot());
  EXPECT_THAT(error_of<ValueError>([&] { task.initialize(scene.model(), 1); }),
              HasSubstr("scene 'table' has no door"));
}

}  // namespace
}  // namespace mjsense::tasks
