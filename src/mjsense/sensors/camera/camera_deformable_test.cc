// SPDX-License-Identifier: Apache-2.0
// Deformable objects in images: flexes and skins.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

CameraSensorCfg camera(int width, int height) {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "eye";
  cfg.width = width;
  cfg.height = height;
  cfg.data_types = {"rgb", "depth", "segmentation", "normals"};
  return cfg;
}

// One camera for the worlds of one model. The test changes `m.data` and renders.
struct TestRenderer {
  rays::RayScene rays;
  std::unique_ptr<Sensor> sensor;
  ThreadPool pool{1};

  TestRenderer(const TestModel& m, const CameraSensorCfg& cfg, int worlds = 1)
      : rays(m.model, worlds), sensor(cfg.build()) {
    SensorInit init;
    init.model = m.model;
    init.num_worlds = worlds;
    sensor->initialize(init);
  }
  void shoot(const World& world) {
    rays.update(world);
    sensor->compute(world);
    sensor->cast({&rays, {&world.id, 1}, pool});
  }
  template <class T>
  std::span<const T> image(const char* field, int world = 0) const {
    return sensor->field(field).data.row<T>(world);
  }
};

int pixel(int x, int y, int width) { return y * width + x; }

// A camera 3 m above the world's origin looks down on a flex of 1 x 1 m.
std::string scene(const std::string& flex, const std::string& more = "") {
  return "<mujoco><worldbody>" + more + flex +
         "<camera name='eye' pos='0 0 3' fovy='40'/></worldbody></mujoco>";
}

constexpr char kCloth[] =
    "<flexcomp name='cloth' type='grid' dim='2' count='11 11 1' spacing='.1 .1 .1' pos='0 0 1' "
    "radius='.01' rgba='.9 .2 .1 1'><edge equality='true'/></flexcomp>";

TEST(CameraFlex, FlatClothAtTwoMetresReadsTwoMetresLessItsRadius) {
  const TestModel m(scene(kCloth));
  TestRenderer studio(m, camera(64, 64));
  studio.shoot(m.world());
  const auto depth = studio.image<float>("depth");
  const auto ids = studio.image<std::int32_t>("segmentation");
  const auto normals = studio.image<float>("normals");
  const auto rgb = studio.image<std::uint8_t>("rgb");
  // 0.5 m at 1.99 m are 22.1 of the 32 pixels from the middle to the border.
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      const int i = pixel(x, y, 64);
      const bool on = std::abs(x - 31.5) < 22 && std::abs(y - 31.5) < 22;
      // Pixels at the border.
      if (!on && std::abs(x - 31.5) < 23 && std::abs(y - 31.5) < 23) continue;
      EXPECT_NEAR(depth[i], on ? 1.99 : 0, 1e-6) << x << ' ' << y;
      EXPECT_EQ(ids[2 * i], on ? 0 : -1);
      EXPECT_EQ(ids[2 * i + 1], on ? static_cast<int>(mjOBJ_FLEX) : -1);
      if (!on) continue;
      EXPECT_NEAR(normals[3 * i + 2], 1, 1e-6);
      EXPECT_GT(rgb[3 * i], rgb[3 * i + 1] + 60);
    }
}

TEST(CameraFlex, MovedClothIsInTheNextImageOfItsWorldOnly) {
  const TestModel m(scene(kCloth));
  TestRenderer studio(m, camera(16, 16), 2);
  const int middle = pixel(8, 8, 16);
  studio.shoot(m.world(0));
  studio.shoot(m.world(1));
  for (int i = 0; i < m.model->nflexvert; ++i) m.data->flexvert_xpos[3 * i + 2] += 0.25;
  studio.shoot(m.world(1));
  EXPECT_NEAR(studio.image<float>("depth", 0)[middle], 1.99, 1e-6);
  EXPECT_NEAR(studio.image<float>("depth", 1)[middle], 1.74, 1e-6);
}

TEST(CameraFlex, BothSidesOfClothAreDrawn) {
  TestModel m(scene(kCloth));
  mju_copy(m.model->cam_pos, std::array{0.0, 0.0, -1.0}.data(), 3);
  mju_copy(m.model->cam_quat, std::array{0.0, 1.0, 0.0, 0.0}.data(), 4);  // looks up
  mj_forward(m.model, m.data);
  TestRenderer studio(m, camera(16, 16));
  studio.shoot(m.world());
  EXPECT_NEAR(studio.image<float>("depth")[pixel(8, 8, 16)], 1.99, 1e-6);
  EXPECT_NEAR(studio.image<float>("normals")[3 * pixel(8, 8, 16) + 2], 1, 1e-6);
}

TEST(CameraFlex, RopeIsRound) {
  const TestModel m(scene(
      "<flexcomp name='rope' type='grid' dim='1' count='11 1 1' spacing='.1 .1 .1' pos='0 0 1' "
      "radius='.04'><edge equality='true'/></flexcomp>"));
  CameraSensorCfg cfg = camera(65, 65);
  TestRenderer studio(m, cfg);
  studio.shoot(m.world());
  const auto depth = studio.image<float>("depth");
  const auto normals = studio.image<float>("normals");
  const double slope = 2 * std::tan(20 * M_PI / 180) / 65;
  for (int y = 31; y <= 33; ++y) {
    // A ray with slope s hits the cylinder y^2 + (z - 2)^2 = 0.04^2 of the camera's frame.
    const double s = slope * (32 - y), a = 1 + s * s, b = -2, c = 4 - 0.0016;
    const double t = (-b - std::sqrt(b * b - a * c)) / a;
    const int i = pixel(32, y, 65);
    EXPECT_NEAR(depth[i], t, 3e-6) << y;
    EXPECT_NEAR(normals[3 * i + 1], s * t / 0.04, 1e-3);
    EXPECT_NEAR(normals[3 * i + 2], (2 - t) / 0.04, 1e-3);
  }
}

TEST(CameraFlex, GroupsAndAlphaHideIt) {
  TestModel m(scene(kCloth));
  TestRenderer studio(m, camera(8, 8));
  m.model->flex_group[0] = 4;
  studio.shoot(m.world());
  EXPECT_EQ(studio.image<std::int32_t>("segmentation")[2 * pixel(4, 4, 8)], -1);
  m.model->flex_group[0] = 1;
  m.model->flex_rgba[3] = 0;
  studio.shoot(m.world());
  EXPECT_EQ(studio.image<std::int32_t>("segmentation")[2 * pixel(4, 4, 8)], -1);
  m.model->flex_rgba[3] = 0.4F;
  studio.shoot(m.world());
  EXPECT_EQ(studio.image<std::int32_t>("segmentation")[2 * pixel(4, 4, 8)], 0);
}

// Light comes from the upper left: the shadow of the cloth is on the floor to its right, and that
// of the ball is on the cloth.
TEST(CameraFlex, ClothCastsAndReceivesShadows) {
  const TestModel m(scene(
      kCloth,
      "<light pos='-3 0 5' dir='1 0 -1' type='directional' castshadow='true' ambient='.1 .1 .1'/>"
      "<geom name='floor' type='plane' size='5 5 .1'/>"
      "<geom name='ball' size='.1' pos='-.3 0 1.5'/>"));
  CameraSensorCfg cfg = camera(128, 128);
  cfg.use_shadows = true;
  TestRenderer studio(m, cfg);
  studio.shoot(m.world());
  const auto red = [&](double x, double y, double depth) {
    const double scale = 64 / (depth * std::tan(20 * M_PI / 180));
    const int i = pixel(static_cast<int>(64 + scale * x), static_cast<int>(64 - scale * y), 128);
    return static_cast<int>(studio.image<std::uint8_t>("rgb")[3 * i]);
  };
  EXPECT_LT(red(0.9, 0, 3), 0.7 * red(-0.9, 0, 3));
  EXPECT_LT(red(0.19, 0, 1.99), 0.7 * red(0.19, 0.3, 1.99));
  EXPECT_NEAR(red(0.19, 0.3, 1.99), red(0.19, -0.3, 1.99), 3);  // the cloth has no shadow on itself
}

// A skin of one square metre, carried by one body.
constexpr char kSkin[] = R"(<mujoco><worldbody>
  <camera name="eye" pos="0 0 3" fovy="40"/>
  <body name="bone" pos="0 0 1"><joint type="slide" axis="0 0 1"/><geom size=".01" group="4"/></body></worldbody>
  <deformable><skin name="patch" rgba=".2 .9 .1 1" group="%" inflate=".01" vertex="-.5 -.5 0 .5 -.5 0 .5 .5 0 -.5 .5 0" face="0 1 2 0 2 3">
    <bone body="bone" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3" vertweight="1 1 1 1"/></skin></deformable></mujoco>)";

std::string skin_in_group(char group) {
  std::string xml = kSkin;
  xml[xml.find('%')] = group;
  return xml;
}

TEST(CameraSkin, FollowsItsBonesInEachWorld) {
  const TestModel m(skin_in_group('0'));
  TestRenderer studio(m, camera(16, 16), 2);
  const int middle = pixel(8, 8, 16);
  studio.shoot(m.world(0));
  m.data->qpos[0] = 0.5;
  mj_forward(m.model, m.data);
  studio.shoot(m.world(1));
  for (int w : {0, 1}) {
    EXPECT_NEAR(studio.image<float>("depth", w)[middle], w ? 1.49 : 1.99, 1e-6);
    EXPECT_EQ(studio.image<std::int32_t>("segmentation", w)[2 * middle], 0);
    EXPECT_EQ(studio.image<std::int32_t>("segmentation", w)[2 * middle + 1], mjOBJ_SKIN);
    EXPECT_NEAR(studio.image<float>("normals", w)[3 * middle + 2], 1, 1e-6);
    EXPECT_GT(studio.image<std::uint8_t>("rgb", w)[3 * middle + 1],
              studio.image<std::uint8_t>("rgb", w)[3 * middle] + 60);
  }
}

TEST(CameraSkin, IsOneSidedAndObeysItsGroup) {
  {
    const TestModel m(skin_in_group('4'));
    TestRenderer studio(m, camera(8, 8));
    studio.shoot(m.world());
    EXPECT_EQ(studio.image<std::int32_t>("segmentation")[2 * pixel(4, 4, 8)], -1);
  }
  const TestModel m(skin_in_group('0'));
  m.data->qpos[0] = 4;  // above the camera
  mj_forward(m.model, m.data);
  TestRenderer studio(m, camera(8, 8));
  studio.shoot(m.world());
  EXPECT_EQ(studio.image<std::int32_t>("segmentation")[2 * pixel(4, 4, 8)], -1);
}

// A scene to test that an image depends only on its own world.
constexpr char kSoft[] = R"(<mujoco><worldbody>
  <light pos="1 -1 3" dir="-.3 .3 -1" castshadow="true" cutoff="60"/><geom type="plane" size="5 5 .1"/>
  <camera name="eye" pos="0 -2 1.5" xyaxes="1 0 0 0 .6 .8"/>
  <flexcomp name="cloth" type="grid" dim="2" count="7 7 1" spacing=".1 .1 .1" pos="-.4 0 .5" radius=".01" mass=".1"><edge equality="true"/></flexcomp>
  <flexcomp name="rope" type="grid" dim="1" count="7 1 1" spacing=".1 .1 .1" pos=".4 0 .5" radius=".02" mass=".1"><edge equality="true"/><pin id="0"/></flexcomp>
  <body name="bone" pos="0 -.6 .4"><joint type="ball"/><geom size=".05" pos=".1 0 0" group="4"/></body></worldbody>
  <deformable><skin name="patch" rgba=".2 .9 .1 1" vertex="-.2 -.2 0 .2 -.2 0 .2 .2 .1 -.2 .2 0" face="0 1 2 0 2 3">
    <bone body="bone" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3" vertweight="1 1 1 1"/></skin></deformable></mujoco>)";

// Bytes of every image of every step, by world; world `first + w` starts with its own velocities.
std::vector<std::string> play(int first, int worlds, int threads) {
  scene::SceneCfg cfg;
  scene::EntityCfg entity;
  entity.model.xml = kSoft;
  cfg.entities.emplace_back("w", entity);
  auto eye = std::make_shared<CameraSensorCfg>(camera(48, 36));
  eye->camera_name = "w/eye";
  eye->use_shadows = true;
  cfg.sensors.push_back(eye);
  auto scene = std::make_shared<scene::Scene>(std::move(cfg));
  sim::Simulation sim(scene, {.num_worlds = worlds, .decimation = 5, .threads = threads});
  const ArrayView qvel = sim.worlds().state_component("qvel");
  for (int row = 0; row < worlds; ++row) {
    auto* v = reinterpret_cast<double*>(qvel.data + row * qvel.strides[0]);
    for (int i = 0; i < sim.model()->nv; ++i) v[i] = 0.5 * std::sin(1.7 * i + first + row);
  }
  sim.forward();
  std::vector<std::string> bytes(worlds);
  Sensor& sensor = scene->sensor("cam");
  for (int k = 0; k < 4; ++k) {
    sim.step();
    sim.refresh(sensor);
    for (const Field& f : sensor.fields())
      for (int row = 0; row < worlds; ++row)
        bytes[row].append(reinterpret_cast<const char*>(f.data.row_data(row)), f.data.row_bytes());
  }
  return bytes;
}

TEST(CameraSoft, ImagesAreBitEqualAtAnyThreadCountAndAmongAnyNumberOfWorlds) {
  const std::vector<std::string> reference = play(0, 5, 1);
  EXPECT_NE(reference[0], reference[1]);
  EXPECT_EQ(play(0, 5, 3), reference);
  EXPECT_EQ(play(3, 1, 2)[0], reference[3]);
}

}  // namespace
}  // namespace mjsense::sensors
