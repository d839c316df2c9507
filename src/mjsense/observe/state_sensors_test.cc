// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/observe/camera_parameters.h"
#include "mjsense/observe/env_states.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/joint_state.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/observe/testing/world.h"

namespace mjsense::observe {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using ::testing::Pointwise;

// A base with one hinge 0.58 m above the floor and a tool site; a cube; a camera that looks along
// +x.
constexpr char kStateScene[] = R"(
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="robot/base" mocap="true" pos="1 0 0" quat="0 0 0 1">
      <body name="robot/link" pos="0 0 .58">
        <joint name="robot/joint" axis="0 0 1"/>
        <geom name="robot/pad" size=".05"/>
        <site name="robot/tool" pos=".3 0 0"/>
      </body>
    </body>
    <body name="thing/cube" pos="3 0 .05"><freejoint/><geom name="cube" type="box" size=".05 .05 .05" mass=".1"/></body>
    <camera name="camera" pos="0 0 1" xyaxes="0 -1 0 0 0 1" fovy="60"/>
    <camera name="chip" pos="0 0 1" xyaxes="0 -1 0 0 0 1" resolution="640 480" sensorsize=".004 .003"
            focal=".003 .0025" principal=".0002 -.0001"/>
    <camera name="map" pos="0 0 1" projection="orthographic" fovy="2"/>
  </worldbody>
</mujoco>)";

std::vector<JointGroup> groups() { return {{"base", {}, {}}, {"arm", {0}, {0}}}; }

TEST(JointState, HasOneStreamPerGroup) {
  TestWorld w(kStateScene);
  w.data->qpos[0] = 0.05;
  w.data->qvel[0] = -1e-5;
  JointStateSensor qpos("qpos", JointStateSensor::What::kPosition, groups());
  JointStateSensor qvel("qvel", JointStateSensor::What::kVelocity, groups());
  w.compute(qpos);
  w.compute(qvel);
  EXPECT_THAT(values<float>(qpos, "arm"), ElementsAre(0.05f));
  EXPECT_THAT(values<float>(qvel, "arm"), ElementsAre(-1e-5f));
  EXPECT_EQ(qpos.field("arm").spec.name, "qpos/arm");
  EXPECT_EQ(qpos.field("arm").spec.unit, "rad");
  EXPECT_EQ(qvel.field("arm").spec.unit, "rad/s");
  EXPECT_EQ(qpos.field("base").spec.shape, Shape({0}));
}

TEST(JointState, UnitsAreThoseOfTheJoints) {
  TestWorld w(R"(<mujoco><worldbody>
    <body><joint type="slide"/><geom size=".1"/></body>
    <body><joint axis="0 0 1"/><geom size=".1"/></body>
    <body><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  EXPECT_EQ(joint_unit(w.model, {"", {0}, {0}}), "m");
  EXPECT_EQ(joint_unit(w.model, {"", {1}, {1}}, "/s"), "rad/s");
  EXPECT_EQ(joint_unit(w.model, {"", {0, 1}, {0, 1}}, "/s"), "rad/s or m/s");
  EXPECT_EQ(joint_unit(w.model, {"", {}, {2, 3, 4}}), "m");
  EXPECT_EQ(joint_unit(w.model, {"", {}, {5, 6, 7}}), "rad");
  EXPECT_EQ(joint_unit(w.model, {}), "");
}

TEST(JsonFunction, RefusesTextLongerThanTheRow) {
  TestWorld w(kStateScene);
  std::string word = "short";
  JsonFunctionSensor info("task_info", 16, "", [&](const World&, JsonWriter& json) {
    json.begin_object().key("w").value(word).end_object();
  });
  w.compute(info);
  EXPECT_EQ(text(info), R"({"w":"short"})");
  word = "very much longer";
  try {
    info.compute(w.world());
    FAIL();
  } catch (const RowError& e) {
    ASSERT_EQ(e.faults.size(), 1u);
    EXPECT_EQ(e.faults[0].world, 0);
    EXPECT_STREQ(e.what(),
                 "sensor 'task_info', world 0: its text needs 24 bytes, str_max_len is 16");
  }
}

TEST(Pose, OfASiteInTheBaseFrame) {
  TestWorld w(kStateScene);
  PoseSensor base("robot_base_pose", {"body", "robot/base"});
  PoseSensor tcp("tcp_pose", {"site", "robot/tool"}, {"body", "robot/base"});
  w.compute(base);
  w.compute(tcp);
  EXPECT_THAT(values<float>(base), ElementsAre(1, 0, 0, 0, 0, 0, 1));
  // The base is rotated by 180 degrees about z, but in the base's frame the tool is in front of it.
  EXPECT_THAT(values<float>(tcp),
              Pointwise(FloatNear(1e-6f), {.3f, 0.f, .58f, 1.f, 0.f, 0.f, 0.f}));
  EXPECT_EQ(tcp.fields()[0].spec.frame, "body robot/base");
}

// A quaternion and its negative are the same rotation: which of them it is does not change between
// steps, over two turns.
TEST(Pose, QuaternionIsContinuousWithinAnEpisode) {
  TestWorld w(kStateScene);
  PoseSensor tcp("tcp_pose", {"site", "robot/tool"}, {"body", "robot/base"});
  tcp.initialize(w.init());
  const auto at = [&](double angle) {
    w.data->qpos[0] = angle;
    mj_forward(w.model, w.data);
    tcp.compute(w.world());
    return values<float>(tcp);
  };
  tcp.reset(w.world());
  std::vector<float> last = at(0);
  for (int step = 1; step <= 80; ++step) {
    const std::vector<float> now = at(step * 0.05 * std::numbers::pi);
    double cosine = 0;
    for (int i = 3; i < 7; ++i) cosine += now[i] * last[i];
    EXPECT_GT(cosine, 0.99) << "step " << step;
    EXPECT_EQ(at(step * 0.05 * std::numbers::pi), now) << "computed again it is the same";
    last = now;
    if (step == 40) {
      EXPECT_NEAR(now[3], -1, 1e-6) << "after one turn";
    }
  }
  at(1.5 * std::numbers::pi);
  tcp.reset(w.world());
  EXPECT_GT(at(1.5 * std::numbers::pi)[3], 0) << "an episode begins with w >= 0";
}

TEST(Pose, NamesTheNearestWhenThereIsNone) {
  TestWorld w(kStateScene);
  PoseSensor tcp("tcp_pose", {"site", "robot/tol"});
  try {
    tcp.initialize(w.init());
    FAIL();
  } catch (const KeyError& e) {
    EXPECT_THAT(
        e.what(),
        HasSubstr("sensor 'tcp_pose': no site named 'robot/tol'; did you mean 'robot/tool'?"));
  }
}

TEST(EnvStates, ContainsEveryFreeBodyAndTheRobot) {
  TestWorld w(kStateScene);
  w.data->qpos[0] = 0.25;
  w.data->qvel[0] = -2;
  for (int i = 0; i < 6; ++i) w.data->qvel[1 + i] = i;
  EnvStatesSensor states("env_states", "panda", groups(), 6, "robot/base");
  w.compute(states);
  ASSERT_EQ(states.fields().size(), 2u);
  EXPECT_EQ(states.fields()[0].spec.name, "env_states/actors/cube");
  EXPECT_EQ(states.fields()[1].spec.name, "env_states/articulations/panda");
  EXPECT_THAT(values<float>(states, "actors/cube"),
              ElementsAre(3, 0, .05f, 1, 0, 0, 0, 0, 1, 2, 3, 4, 5));
  EXPECT_THAT(values<float>(states, "articulations/panda"), ElementsAre(.25f, -2, 0, 0, 0, 0));
  EXPECT_THROW(EnvStatesSensor("env_states", "panda", groups(), 1, "robot/base"), ValueError);
  EnvStatesSensor minimum("env_states", "arm", groups(), 0, "robot/base");
  w.compute(minimum);
  EXPECT_THAT(values<float>(minimum, "articulations/arm"), ElementsAre(.25f, -2));
}

// The row of an absent actor is zero and its flag is false. Actors that cannot be absent have no
// flag.
TEST(EnvStates, AbsentActorsAreMasked) {
  TestWorld w(R"(<mujoco><worldbody><body name="a/cup"><freejoint/><geom size=".1"/></body>
    <body name="a/mug" pos="2 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  bool there = true;
  EnvStatesSensor states("env_states", "panda", {}, 3, "", "",
                         {{2}, [&](int /*world*/, int body) { return body != 2 || there; }});
  w.compute(states);
  std::vector<std::string> names;
  for (const Field& f : states.fields()) names.push_back(f.name);
  EXPECT_THAT(names, ElementsAre("actors/cup", "actors/mug", "articulations/panda", "present/mug"));
  EXPECT_EQ(values<float>(states, "actors/mug")[0], 2);
  EXPECT_TRUE(states.fields()[3].data.row<bool>(0)[0]);
  there = false;
  states.compute(w.world());
  EXPECT_THAT(values<float>(states, "actors/mug"),
              ::testing::ElementsAreArray(std::vector<float>(13)));
  EXPECT_EQ(values<float>(states, "actors/cup")[3], 1);
  EXPECT_FALSE(states.fields()[3].data.row<bool>(0)[0]);
}

// The same for an object that has joints of its own: none of its rows contains a pose.
TEST(EnvStates, AbsentArticulationsAreMasked) {
  TestWorld w(R"(<mujoco><worldbody>
    <body name="robot/base"><joint axis="0 0 1"/><geom size=".1"/></body>
    <body name="box" pos="2 0 0"><freejoint/><geom size=".1"/>
      <body pos="0 0 .2"><joint/><geom size=".1"/></body></body></worldbody></mujoco>)");
  bool there = true;
  EnvStatesSensor states("env_states", "", {}, 0, "robot/base", "arm",
                         {{2}, [&](int /*world*/, int body) { return body != 2 || there; }});
  w.compute(states);
  std::vector<std::string> names;
  for (const Field& f : states.fields()) names.push_back(f.name);
  EXPECT_THAT(names,
              ElementsAre("actors/box", "articulations/arm", "articulations/box", "present/box"));
  EXPECT_EQ(values<double>(states, "articulations/box")[0], 2);
  there = false;
  states.compute(w.world());
  EXPECT_THAT(values<double>(states, "articulations/box"),
              ::testing::ElementsAreArray(std::vector<double>(15)));
  EXPECT_FALSE(states.fields()[3].data.row<bool>(0)[0]);
}

// Every tree of joints, with the precision of the simulation: the robot, and other articulated objects.
TEST(EnvStates, ArticulationsHaveAllTheirJoints) {
  TestWorld w(R"(<mujoco><worldbody>
    <body name="robot/base"><joint axis="0 0 1"/><geom size=".1"/></body>
    <body name="room/drawer" pos="1 0 0"><joint type="slide"/><geom size=".1"/>
      <body><joint type="ball"/><geom size=".1"/></body></body>
    <body name="room/cup" pos="2 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  w.data->qpos[0] = 0.1;
  w.data->qvel[0] = -0.2;
  w.data->qpos[1] = 0.3;
  w.data->qvel[1] = 0.4;
  EnvStatesSensor states("env_states", "", {}, 0, "robot/base", "panda");
  w.compute(states);
  std::vector<std::string> names;
  for (const Field& f : states.fields()) names.push_back(f.name);
  EXPECT_THAT(names, ElementsAre("actors/cup", "articulations/panda", "articulations/room_drawer"));
  EXPECT_THAT(values<double>(states, "articulations/panda"), ElementsAre(0.1, -0.2));
  EXPECT_THAT(values<double>(states, "articulations/room_drawer"),
              ElementsAre(0.3, 1, 0, 0, 0, 0.4, 0, 0, 0));
}

// Actors whose bodies have the same local name are distinguished by the names of their entities.
TEST(EnvStates, ActorsWithTheSameNameKeepTheirEntities) {
  TestWorld w(R"(<mujoco><worldbody><body name="left/cup"><freejoint/><geom size=".1"/></body>
    <body name="right/cup" pos="1 0 0"><freejoint/><geom size=".1"/></body>
    <body name="right/mug" pos="2 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  EnvStatesSensor states("env_states", "panda", {}, 3, "");
  w.compute(states);
  std::vector<std::string> names;
  for (const Field& f : states.fields()) names.push_back(f.name);
  EXPECT_THAT(names, ElementsAre("actors/left_cup", "actors/right_cup", "actors/mug",
                                 "articulations/panda"));
  EXPECT_EQ(values<float>(states, "actors/right_cup")[0], 1);
}

TEST(CameraParameters, ProjectKnownPoints) {
  TestWorld w(kStateScene);
  CameraParameterSensor camera("sensor_param_camera", "camera", 640, 368);
  w.compute(camera);
  const auto X = values<double>(camera, "cam2world_gl");
  const auto E = values<double>(camera, "extrinsic_cv");
  const auto K = values<double>(camera, "intrinsic_cv");
  // The camera looks along +x from (0, 0, 1): right is -y, down is -z.
  EXPECT_THAT(X, Pointwise(::testing::DoubleNear(1e-12),
                           {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 1}));
  const double f = static_cast<float>(184 / std::tan(std::numbers::pi / 6));
  EXPECT_THAT(K, ElementsAre(f, 0, 320, 0, f, 184, 0, 0, 1));

  const auto project = [&](double x, double y, double z) {
    double c[3], k[3];
    for (int i = 0; i < 3; ++i)
      c[i] = E[4 * i] * x + E[4 * i + 1] * y + E[4 * i + 2] * z + E[4 * i + 3];
    for (int i = 0; i < 3; ++i) k[i] = K[3 * i] * c[0] + K[3 * i + 1] * c[1] + K[3 * i + 2] * c[2];
    return std::pair{k[0] / k[2], k[1] / k[2]};
  };
  const auto [u0, v0] = project(2, 0, 1);
  EXPECT_NEAR(u0, 320, 1e-9);
  EXPECT_NEAR(v0, 184, 1e-9);
  const auto [u1, v1] =
      project(2, -.5, 1 + 2 * std::tan(std::numbers::pi / 6));  // at the right, on the upper edge
  EXPECT_NEAR(u1, 320 + f / 4, 1e-4);
  EXPECT_NEAR(v1, 0, 1e-4);
}

// A turned camera that is not the model's first.
TEST(CameraParameters, TheTwoPosesAreInverse) {
  TestWorld w(R"(<mujoco><worldbody><camera name="first"/>
    <body pos="1 2 3" euler="10 20 30"><camera name="second" pos=".1 .2 .3" euler="40 50 60"/></body>
    </worldbody></mujoco>)");
  CameraParameterSensor camera("p", "second", 64, 48);
  w.compute(camera);
  const auto X = values<double>(camera, "cam2world_gl"), E = values<double>(camera, "extrinsic_cv");
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(X[4 * i + 3], w.data->cam_xpos[3 + i]);
    for (int j = 0; j < 4; ++j) {
      double sum = 0;
      for (int k = 0; k < 4; ++k) sum += E[4 * i + k] * X[4 * k + j];
      EXPECT_NEAR(sum, i == j, 1e-12) << i << " " << j;
    }
  }
  EXPECT_EQ(camera.field("cam2world_gl").spec.frame, "world");
  EXPECT_EQ(camera.field("extrinsic_cv").spec.frame, "camera");
  EXPECT_EQ(camera.field("intrinsic_cv").spec.frame, "pixels");
}

TEST(CameraParameters, APictureHasPixels) {
  EXPECT_THROW(CameraParameterSensor("p", "camera", 0, 1), ValueError);
  EXPECT_THROW(CameraParameterSensor("p", "camera", 1, 0), ValueError);
  EXPECT_NO_THROW(CameraParameterSensor("p", "camera", 1, 1));
}

TEST(CameraParameters, MatrixOfACameraWithASensor) {
  TestWorld w(kStateScene);
  CameraParameterSensor camera("sensor_param_chip", "chip", 640, 480);
  w.compute(camera);
  // 640 pixels on 4 mm. MuJoCo's principal point is that of the sensor in the frame of the lens.
  const auto K = values<double>(camera, "intrinsic_cv");
  const double pixel = 640 / .004;
  const std::vector<double> expected = {
      .003 * pixel, 0, 320 - .0002 * pixel, 0, .0025 * pixel, 240 + .0001 * pixel, 0, 0, 1};
  EXPECT_THAT(K, Pointwise(::testing::DoubleNear(1e-3), expected));
  CameraParameterSensor map("sensor_param_map", "map", 640, 480);
  EXPECT_THROW(w.compute(map), ValueError);
}

}  // namespace
}  // namespace mjsense::observe
