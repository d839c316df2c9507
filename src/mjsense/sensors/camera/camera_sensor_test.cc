// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/camera_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>

#include "mjsense/core/control_step.h"
#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/testing/allocations.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::HasSubstr;

// A scene with one entity "w" and cameras.
struct CameraLab : testing::Lab {
  using Lab::Lab;
  CameraLab(const std::string& worldbody, std::vector<CameraSensorCfg> cameras,
            sim::SimulationCfg cfg = {})
      : Lab("w", "<mujoco>" + worldbody + "</mujoco>", shared(std::move(cameras)), cfg) {}

  template <class T>
  std::vector<T> read(std::string_view field, std::string_view name = "cam", int world = -1) {
    return Lab::read<T>(field, name, world);
  }
};

CameraSensorCfg camera(int width, int height, std::vector<std::string> types,
                       std::string wrapped = "") {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = std::move(wrapped);
  cfg.width = width;
  cfg.height = height;
  cfg.data_types = std::move(types);
  return cfg;
}

// The scene of the published cases: an overhead camera at 4 m above a floor, a box and a ball.
constexpr char kCases[] = R"(<worldbody><light pos="0 0 3" dir="0 0 -1"/>
  <geom name="floor" type="plane" size="10 10 .1" rgba=".5 .5 .5 1"/>
  <geom name="box" type="box" size=".5 .5 .5" pos="0 0 .5" rgba="1 0 0 1"/>
  <geom name="ball" size=".3" pos="1.2 .6 .9" rgba="0 1 0 1" group="1"/>
  <geom name="vis3" type="box" size=".2 .2 .2" pos="-1.2 -.6 1.5" group="3"/>
  <camera name="top" pos="0.03 0.02 4" fovy="50" resolution="8 6"/>
  <camera name="phys" pos="0.02 0.03 4" resolution="8 6" sensorsize=".008 .006"
          focal=".006 .006" principal=".0005 -.0003"/></worldbody>)";

TEST(Camera, DepthIsPlanarAndIdsAreGeoms) {
  CameraLab lab(kCases, {camera(8, 6, {"depth", "segmentation"}, "w/top")});
  const auto depth = lab.read<float>("depth");
  const auto ids = lab.read<std::int32_t>("segmentation");
  ASSERT_EQ(depth.size(), 48u);
  // Row 1, column 6 is the ball, columns 3 and 4 of rows 2 and 3 the box; the rest is floor.
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 8; ++x) {
      const int i = 8 * y + x;
      const bool ball = y == 1 && x == 6, box = (y == 2 || y == 3) && (x == 3 || x == 4);
      EXPECT_NEAR(depth[i], ball ? 2.8198407 : box ? 3.0 : 4.0, 1e-5) << x << ", " << y;
      EXPECT_EQ(ids[2 * i], ball ? 2 : box ? 1 : 0) << x << ", " << y;
      EXPECT_EQ(ids[2 * i + 1], mjOBJ_GEOM);
    }
}

TEST(Camera, PixelsHaveBodyAndEntityIds) {
  scene::SceneCfg cfg;
  cfg.terrain.emplace();
  for (const char* name : {"a", "b"}) {
    scene::EntityCfg e;
    e.model.xml = R"(<mujoco><worldbody><body name="ball"><freejoint/><geom size=".3"/></body>
                     </worldbody></mujoco>)";
    cfg.entities.emplace_back(name, e);
  }
  CameraSensorCfg all =
      camera(32, 16, {"segmentation", "body_segmentation", "entity_segmentation"});
  all.pos = {0, 0, 5};
  CameraSensorCfg entities = camera(32, 16, {"entity_segmentation"});
  entities.camera_name = "cam";
  entities.name = "entities";
  for (const CameraSensorCfg& c : {all, entities})
    cfg.sensors.push_back(std::make_shared<CameraSensorCfg>(c));
  CameraLab lab(std::move(cfg), {.num_worlds = 2, .threads = 2});
  for (int world : {0, 1})
    lab.pose({-1, 0, 1, 1, 0, 0, 0, 1 + 20.0 * world, 0, 1, 1, 0, 0, 0}, world);
  const mjModel* m = lab.scene->model();
  int seen[3] = {};
  for (int world : {0, 1}) {
    const auto ids = lab.read<std::int32_t>("segmentation", "cam", world);
    const auto bodies = lab.read<std::int32_t>("body_segmentation", "cam", world);
    const auto owners = lab.read<std::int32_t>("entity_segmentation", "cam", world);
    EXPECT_EQ(owners, lab.read<std::int32_t>("entity_segmentation", "entities", world));
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      ASSERT_EQ(bodies[i], m->geom_bodyid[ids[2 * i]]);
      const int body = bodies[i];  // terrain, a/ball and b/ball have one geom each
      ASSERT_EQ(owners[i], ids[2 * i]) << body;
      ++seen[owners[i]];
    }
    // In world 1, b is out of sight.
    EXPECT_EQ(std::count(owners.begin(), owners.end(), 2) > 0, world == 0);
  }
  EXPECT_GT(seen[0], seen[1]);
  EXPECT_GT(seen[1], seen[2]);
}

// A cloth above a floor, each of them an entity.
TEST(Camera, PixelsOfAFlexHaveItsEntityId) {
  scene::SceneCfg cfg;
  cfg.terrain.emplace();
  scene::EntityCfg cloth;
  cloth.model.xml = R"(<mujoco><worldbody><flexcomp name="cloth" type="grid" dim="2" count="5 5 1"
    spacing=".3 .3 .3" pos="0 0 1"><edge equality="true"/></flexcomp></worldbody></mujoco>)";
  cfg.entities.emplace_back("curtain", cloth);
  CameraSensorCfg all = camera(32, 16, {"segmentation", "entity_segmentation"});
  all.pos = {0, 0, 5};
  cfg.sensors.push_back(std::make_shared<CameraSensorCfg>(all));
  CameraLab lab(std::move(cfg), {});
  const auto ids = lab.read<std::int32_t>("segmentation");
  const auto owners = lab.read<std::int32_t>("entity_segmentation");
  int seen[2] = {};
  for (std::size_t i = 0; i < owners.size(); ++i) {
    ASSERT_EQ(owners[i], ids[2 * i + 1] == mjOBJ_FLEX) << ids[2 * i + 1];
    ++seen[owners[i]];
  }
  EXPECT_GT(seen[0], 100);
  EXPECT_GT(seen[1], 20);
}

TEST(Camera, OneCameraServesSensorsWithDifferentGroups) {
  CameraSensorCfg without_ball = camera(8, 6, {"segmentation"}, "w/top");
  CameraSensorCfg with_hidden = without_ball;
  without_ball.enabled_geom_groups = {0};
  with_hidden.name = "all";
  with_hidden.enabled_geom_groups = {0, 1, 2, 3};
  CameraLab lab(kCases, {without_ball, with_hidden});
  const auto few = lab.read<std::int32_t>("segmentation");
  const auto all = lab.read<std::int32_t>("segmentation", "all");
  EXPECT_EQ(few[2 * (8 * 1 + 6)], 0);
  EXPECT_EQ(all[2 * (8 * 1 + 6)], 2);
  EXPECT_EQ(few[2 * (8 * 4 + 0)], 0);
  EXPECT_EQ(all[2 * (8 * 4 + 0)], 3);
}

TEST(Camera, SphereAtTwoMetresReadsTwoMetres) {
  CameraSensorCfg cfg = camera(31, 31, {"depth", "normals", "point_cloud"});
  cfg.pos = {0, 0, 2.5};
  CameraLab lab(R"(<worldbody><geom size=".5"/></worldbody>)", {cfg});
  const int center = 15 * 31 + 15;
  EXPECT_NEAR(lab.read<float>("depth")[center], 2.0, 1e-6);
  const auto n = lab.read<float>("normals");
  EXPECT_NEAR(n[3 * center + 2], 1.0, 1e-6);
  const auto p = lab.read<float>("point_cloud");
  EXPECT_NEAR(p[3 * center + 2], -2.0, 1e-6);
  // Every point of the cloud is on the sphere, and every normal points away from its centre.
  int hits = 0;
  for (std::size_t i = 0; i < p.size() / 3; ++i) {
    if (std::isnan(p[3 * i])) continue;
    ++hits;
    const double r[3] = {p[3 * i], p[3 * i + 1], p[3 * i + 2] + 2.5};
    EXPECT_NEAR(std::hypot(r[0], r[1], r[2]), 0.5, 1e-5);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(n[3 * i + k], r[k] / 0.5, 1e-4);
  }
  EXPECT_GT(hits, 100);
}

TEST(Camera, KnownPointsProjectToTheRightPixels) {
  CameraLab lab(kCases, {camera(64, 48, {"segmentation"}, "w/phys")});
  const auto ids = lab.read<std::int32_t>("segmentation");
  const auto k = lab.read<float>("intrinsics");
  const auto pose = lab.read<float>("pose");
  const double ball[3] = {1.2, 0.6, 0.9};
  double c[3] = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i] += pose[4 * j + i] * (ball[j] - pose[4 * j + 3]);
  const double u = k[0] * c[0] / -c[2] + k[2], v = k[4] * -c[1] / -c[2] + k[5];
  // The centre of a small sphere's outline is the image of its centre, to a fraction of a pixel.
  double x = 0, y = 0, n = 0;
  for (int i = 0; i < 64 * 48; ++i) {
    if (ids[2 * i] != 2) continue;
    x += i % 64 + 0.5;
    y += i / 64 + 0.5;
    ++n;
  }
  ASSERT_GT(n, 10);
  EXPECT_NEAR(x / n, u, 0.7);
  EXPECT_NEAR(y / n, v, 0.7);
}

TEST(Camera, RayDepthIsThePointsDistance) {
  CameraSensorCfg cfg = camera(16, 12, {"depth", "point_cloud"}, "w/top");
  cfg.depth_kind = "ray";
  CameraLab lab(kCases, {cfg});
  const auto d = lab.read<float>("depth"), p = lab.read<float>("point_cloud");
  for (std::size_t i = 0; i < d.size(); ++i)
    EXPECT_NEAR(d[i], std::hypot(p[3 * i], p[3 * i + 1], p[3 * i + 2]), 1e-5);
}

TEST(Camera, OrthographicRaysAreParallel) {
  CameraSensorCfg cfg = camera(4, 4, {"depth", "point_cloud"});
  cfg.pos = {0.03, 0.02, 4.0};
  cfg.fovy = 3.0;  // m
  cfg.orthographic = true;
  CameraLab lab(kCases, {cfg});
  const auto d = lab.read<float>("depth");
  const auto p = lab.read<float>("point_cloud");
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      const double px = (x + 0.5) * 0.75 - 1.5, py = 1.5 - (y + 0.5) * 0.75;
      EXPECT_NEAR(p[3 * (4 * y + x)], px, 1e-6);
      EXPECT_NEAR(p[3 * (4 * y + x) + 1], py, 1e-6);
      const bool box = std::abs(px + 0.03) < 0.5 && std::abs(py + 0.02) < 0.5;
      EXPECT_NEAR(d[4 * y + x], box ? 3.0 : d[4 * y + x] < 3.9 ? d[4 * y + x] : 4.0, 1e-6);
    }
}

TEST(Camera, SeesWhatMuJoCoDraws) {
  // A geom with alpha 0 is invisible; a shell is transparent from inside; a plane is visible from
  // one side.
  CameraSensorCfg cfg = camera(3, 3, {"depth", "segmentation"}, "w/c");
  CameraLab lab(R"(<worldbody><geom name="floor" type="plane" size="10 10 .1"/>
    <geom name="ghost" size=".3" pos="0 0 1" rgba="1 1 1 0"/><geom name="shell" size=".5" pos="0 0 3"/>
    <camera name="c" pos=".02 .01 3" fovy="30"/><camera name="below" pos="0 0 -1" quat="0 1 0 0"/>
    </worldbody>)",
                {cfg});
  for (float d : lab.read<float>("depth")) EXPECT_NEAR(d, 3.0, 1e-5);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(lab.read<std::int32_t>("segmentation")[2 * i], 0);
}

TEST(Camera, BackgroundIsZeroOrMinusOne) {
  CameraSensorCfg cfg = camera(5, 5, {"rgb", "depth", "segmentation", "normals"});
  cfg.quat = {0, 1, 0, 0};  // looks up
  CameraLab lab(R"(<worldbody><geom size=".1"/></worldbody>)", {cfg});
  for (auto v : lab.read<std::uint8_t>("rgb")) EXPECT_EQ(v, 0);
  for (auto v : lab.read<float>("depth")) EXPECT_EQ(v, 0);
  for (auto v : lab.read<std::int32_t>("segmentation")) EXPECT_EQ(v, -1);
  for (auto v : lab.read<float>("normals")) EXPECT_EQ(v, 0);
}

// From far away, a tile is as bright as the mean of its texture, also if the texture's size is odd.
TEST(Camera, DistantTexturesKeepTheirBorders) {
  CameraSensorCfg cfg = camera(40, 40, {"rgb"});
  cfg.pos = {0, 0, 4};
  // 15 x 15 texels, the outermost ones white, and two texels per pixel.
  CameraLab lab(R"(<asset><texture name="t" type="2d" builtin="flat" mark="edge" rgb1="0 0 0"
                     markrgb="1 1 1" width="15" height="15"/>
               <material name="m" texture="t" texrepeat="6.4 6.4" emission="1" specular="0"/></asset>
             <worldbody><light active="false"/><geom type="plane" size="2 2 .1" material="m"/>
             </worldbody>)",
                {cfg});
  const auto rgb = lab.read<std::uint8_t>("rgb");
  const double mean = std::accumulate(rgb.begin(), rgb.end(), 0.0) / rgb.size();
  EXPECT_NEAR(mean, 255 * (15 * 15 - 13 * 13) / (15.0 * 15), 8);
}

TEST(Camera, ClipRangeHidesWhatIsNearerOrFarther) {
  CameraSensorCfg cfg = camera(8, 6, {"segmentation"}, "w/top");
  cfg.near = 2.9;
  cfg.far = 3.5;
  CameraLab lab(kCases, {cfg});
  const auto ids = lab.read<std::int32_t>("segmentation");
  EXPECT_EQ(ids[2 * (8 * 2 + 3)], 1);
  EXPECT_EQ(ids[0], -1);               // the floor is too far
  EXPECT_NE(ids[2 * (8 * 1 + 6)], 2);  // the top of the ball is too near
}

// A body that falls and turns, and everything else that images can contain.
constexpr char kShow[] = R"(
  <asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 0" width="32" height="32"/>
    <texture name="t" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
    <texture name="q" type="cube" builtin="gradient" rgb1="1 1 0" rgb2="0 1 1" width="16" height="16"/>
    <material name="m" texture="t" texrepeat="3 3"/><material name="n" texture="q"/>
    <mesh name="tet" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
  <worldbody><light pos="1 1 4" dir="-.2 -.2 -1" castshadow="true"/><geom type="plane" size="0 0 .1" material="m"/>
    <body name="b" pos="0 0 1"><freejoint/><geom type="box" size=".3 .2 .1" material="n"/>
      <geom type="capsule" size=".05 .3" pos="0 0 .3" rgba=".2 .9 .2 1"/></body>
    <geom type="mesh" mesh="tet" pos=".5 .2 0"/><geom type="ellipsoid" size=".3 .2 .1" pos="-.6 .3 .2" rgba=".9 .5 .1 .5"/>
    <geom type="cylinder" size=".1 .3" pos="-.3 -.6 .3" material="m"/>
    <camera name="c" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 1"/></worldbody>)";

std::vector<std::byte> rows(int worlds, int threads, int world, int width, int height) {
  CameraSensorCfg cfg =
      camera(width, height, {"rgb", "depth", "segmentation", "normals", "point_cloud"}, "w/c");
  cfg.use_shadows = true;
  sim::SimulationCfg sim;
  sim.num_worlds = worlds;
  sim.threads = threads;
  CameraLab lab(kShow, {cfg}, sim);
  lab.pose({0.1, 0.05, 0.8, 0.9, 0.3, 0.2, 0.1}, world);
  lab.sim->refresh(lab.scene->sensor("cam"));
  std::vector<std::byte> all;
  for (const Field& f : lab.scene->sensor("cam").fields()) {
    const std::byte* row = f.data.row_data(world);
    all.insert(all.end(), row, row + f.data.row_bytes());
  }
  return all;
}

TEST(Camera, ImagesAreBitEqualAtAnyThreadCountAndAmongAnyNumberOfWorlds) {
  const auto one = rows(1, 1, 0, 50, 37);
  EXPECT_EQ(one, rows(1, 2, 0, 50, 37));
  EXPECT_EQ(one, rows(1, 5, 0, 50, 37));
  EXPECT_EQ(one, rows(16, 1, 7, 50, 37));
  EXPECT_EQ(one, rows(16, 5, 15, 50, 37));
}

TEST(Camera, TeleportedObjectIsInTheNextImage) {
  sim::SimulationCfg sim;
  sim.num_worlds = 3;
  CameraLab lab(
      R"(<worldbody><body><joint type="slide" axis="1 0 0"/><geom size=".2"/></body></worldbody>)",
      {camera(21, 21, {"segmentation"})}, sim);
  EXPECT_EQ(lab.read<std::int32_t>("segmentation", "cam", 1)[2 * (10 * 21 + 10)], 0);
  lab.pose({5.0}, 1);
  EXPECT_EQ(lab.read<std::int32_t>("segmentation", "cam", 1)[2 * (10 * 21 + 10)], -1);
  EXPECT_EQ(lab.read<std::int32_t>("segmentation", "cam", 2)[2 * (10 * 21 + 10)], 0);
  lab.sim->reset(std::vector<int>{1});
  EXPECT_EQ(lab.read<std::int32_t>("segmentation", "cam", 1)[2 * (10 * 21 + 10)], 0);
}

TEST(Camera, OwnRateHoldsTheImageBetweenTicks) {
  CameraSensorCfg cfg = camera(9, 9, {"depth"});
  cfg.pos = {0, 0, 10};
  cfg.update_period = 0.01;  // 5 steps of 2 ms
  CameraLab lab(R"(<worldbody><body><freejoint/><geom size=".2"/></body></worldbody>)", {cfg});
  std::vector<float> seen;
  for (int i = 0; i < 11; ++i) {
    seen.push_back(lab.read<float>("depth")[40]);
    lab.sim->step();
  }
  for (int i = 0; i < 5; ++i) EXPECT_EQ(seen[i], seen[0]);
  EXPECT_GT(seen[5], seen[4]);
  for (int i = 5; i < 10; ++i) EXPECT_EQ(seen[i], seen[5]);
  EXPECT_GT(seen[10], seen[9]);
}

// An image that was due when something else failed, before it was rendered, is rendered at the next
// opportunity.
TEST(Camera, ErrorElsewhereDoesNotLoseAnImage) {
  struct Failing final : Sensor, ControlStepListener {
    Failing() : Sensor("failing") {}
    std::string_view kind() const override { return "test"; }
    void initialize(const SensorInit&) override {}
    void compute(const World&) override {}
    void control_step(std::span<const int> ids) override {
      if (std::exchange(fails, false)) throw RowError({{ids[0], "failed"}});
    }
    bool fails = false;
  };
  CameraSensorCfg cfg = camera(9, 9, {"depth"});
  cfg.pos = {0, 0, 10};
  cfg.update_period = 0.01;  // 5 steps of 2 ms
  CameraLab lab(R"(<worldbody><body><freejoint/><geom size=".2"/></body></worldbody>)", {cfg});
  const auto failing = std::make_shared<Failing>();
  lab.sim->add(failing);
  const float first = lab.read<float>("depth")[40];
  for (int i = 0; i < 4; ++i) {
    lab.sim->step();
    lab.read<float>("depth");
  }
  failing->fails = true;
  EXPECT_THROW(lab.sim->step(), RowError);
  lab.sim->step();
  EXPECT_GT(lab.read<float>("depth")[40], first);
}

TEST(Camera, NoAllocationPerFrame) {
  CameraSensorCfg cfg = camera(40, 30, {"rgb", "depth", "segmentation", "normals"}, "w/c");
  cfg.use_shadows = true;
  CameraLab lab(kShow, {cfg});
  Sensor& sensor = lab.scene->sensor("cam");
  lab.sim->step();
  lab.sim->refresh(sensor);
  lab.sim->step();
  lab.sim->refresh(sensor);
  const AllocationCount before;
  lab.sim->step();
  lab.sim->refresh(sensor);
  EXPECT_EQ(before.since(), 0);
}

TEST(Camera, StereoNoiseGrowsWithTheSquareOfDepth) {
  double spread[2];
  for (int i = 0; i < 2; ++i) {
    const double z = i == 0 ? 1.0 : 2.0;
    CameraSensorCfg cfg = camera(64, 64, {"depth"});
    cfg.pos = {0, 0, z};
    cfg.fovy = 60;
    cfg.depth_noise = "d435";
    CameraLab lab(R"(<worldbody><geom type="plane" size="9 9 1"/></worldbody>)", {cfg});
    const auto depth = lab.read<float>("depth");
    double sum = 0, square = 0;
    for (float d : depth) {
      sum += d - z;
      square += (d - z) * (d - z);
    }
    EXPECT_NEAR(sum / 4096, 0, 0.002 * z * z);
    spread[i] = std::sqrt(square / 4096);
    // f = 848 / (2 tan 30), b = 0.05, noise of 0.08 pixels and rounding to 1/32 pixel.
    const double f = 848 / (2 * std::tan(M_PI / 6)),
                 sigma = std::hypot(0.08, 1 / 32.0 / std::sqrt(12.0));
    EXPECT_NEAR(spread[i], z * z * sigma / (f * 0.05), 0.05 * spread[i]);
    // The same time gives the same noise; another time gives other noise.
    lab.sim->invalidate();
    EXPECT_EQ(depth, lab.read<float>("depth"));
    lab.sim->step();
    EXPECT_NE(depth, lab.read<float>("depth"));
  }
  EXPECT_NEAR(spread[1] / spread[0], 4, 0.2);
}

// Depth image of a floor whose normal is at `tilt_deg` to the axis of a camera 1 m away.
std::vector<float> depth_of_tilted_floor(double tilt_deg, int size, DepthNoise noise) {
  CameraSensorCfg cfg = camera(size, size, {"depth"});
  const double half = tilt_deg * M_PI / 360;
  cfg.pos = {0, -std::sin(2 * half), std::cos(2 * half)};
  cfg.quat = {std::cos(half), std::sin(half), 0, 0};
  cfg.fovy = 2;
  cfg.depth_noise = noise;
  CameraLab lab(R"(<worldbody><geom type="plane" size="90 90 1"/></worldbody>)", {cfg});
  return lab.read<float>("depth");
}

TEST(Camera, StereoLosesSurfacesSeenEdgeOnAtAnyResolution) {
  for (int size : {20, 100}) {
    const auto lost = [&](double tilt) {
      const auto depth = depth_of_tilted_floor(tilt, size, DepthNoise::kD435);
      return static_cast<double>(std::count(depth.begin(), depth.end(), 0.0f)) / depth.size();
    };
    EXPECT_EQ(lost(0), 0);
    EXPECT_EQ(lost(70), 0);
    EXPECT_NEAR(lost(83), 0.7, 0.1);
  }
}

TEST(Camera, StereoMeasuresNothingOutOfItsRange) {
  CameraSensorCfg cfg = camera(32, 32, {"depth"});
  cfg.fovy = 60;
  cfg.depth_noise = "d405";  // range 0.07 to 2 m
  const auto depth_at = [&](double z) {
    cfg.pos = {0, 0, z};
    CameraLab lab(R"(<worldbody><geom type="plane" size="9 9 1"/></worldbody>)", {cfg});
    return lab.read<float>("depth");
  };
  EXPECT_THAT(depth_at(0.06), ::testing::Each(0.0f));
  EXPECT_THAT(depth_at(2.3), ::testing::Each(0.0f));
  EXPECT_THAT(depth_at(1.0), ::testing::Each(::testing::Gt(0.0f)));
  // Near the end of the range, noise decides which pixels are lost.
  const auto border = depth_at(2.0);
  EXPECT_THAT(border, ::testing::Each(::testing::Le(2.0f)));
  EXPECT_NEAR(std::count(border.begin(), border.end(), 0.0f), 512, 120);
}

TEST(Camera, StereoLosesHalfOfThePixelsAtEdges) {
  CameraSensorCfg cfg = camera(200, 200, {"depth", "segmentation"});
  cfg.pos = {0, 0, 3};
  cfg.depth_noise = "d435";
  CameraLab lab(R"(<worldbody><geom type="plane" size="9 9 1"/>
             <geom type="box" size=".5 .5 .5" pos="0 0 .5"/></worldbody>)",
                {cfg});
  const auto depth = lab.read<float>("depth");
  const auto ids = lab.read<std::int32_t>("segmentation");
  int edges = 0, lost = 0, lost_elsewhere = 0;
  for (int y = 1; y < 199; ++y)
    for (int x = 1; x < 199; ++x) {
      const int i = 200 * y + x;
      bool edge = false;
      for (int j : {i - 1, i + 1, i - 200, i + 200}) edge |= ids[2 * j] != ids[2 * i];
      edges += edge;
      (edge ? lost : lost_elsewhere) += depth[i] == 0;
    }
  EXPECT_GT(edges, 400);
  EXPECT_NEAR(lost, 0.5 * edges, 2 * std::sqrt(edges));
  EXPECT_EQ(lost_elsewhere, 0);
}

TEST(Camera, OwnRateNeedNotBeAMultipleOfSteps) {
  CameraSensorCfg cfg = camera(9, 9, {"depth"});
  cfg.pos = {0, 0, 10};
  cfg.update_period = 1.0 / 30;  // 16.67 steps of 2 ms
  cfg.phase = 0.01;
  CameraLab lab(R"(<worldbody><body><freejoint/><geom size=".2"/></body></worldbody>)", {cfg});
  std::vector<int> taken;
  float last = lab.read<float>("depth")[40];
  for (int step = 1; step <= 500; ++step) {  // 1 s
    lab.sim->step();
    const float now = lab.read<float>("depth")[40];
    if (now != last) taken.push_back(step);
    last = now;
  }
  ASSERT_EQ(taken.size(), 30u);
  for (int k = 0; k < 30; ++k)
    EXPECT_EQ(taken[k], std::ceil((0.01 + k / 30.0) / 0.002 - 1e-6)) << k;
}

TEST(Camera, OwnFieldOfViewDoesNotAffectOtherSensors) {
  CameraSensorCfg plain = camera(8, 6, {"depth"}, "w/phys"), wide = plain, map = plain;
  wide.name = "wide";
  wide.fovy = 90;
  map.name = "map";
  map.fovy = 3;
  map.orthographic = true;
  CameraLab lab(kCases, {wide, plain, map});
  // Pixels per unit of X/Z: 6 / .006 * .006 from the sensor, 3 from 90 degrees, and 6 pixels on 3
  // m.
  EXPECT_NEAR(lab.read<float>("intrinsics", "cam")[4], 6, 1e-4);
  EXPECT_NEAR(lab.read<float>("intrinsics", "wide")[4], 3, 1e-4);
  EXPECT_NEAR(lab.read<float>("intrinsics", "map")[4], 2, 1e-4);
}

TEST(Camera, ErrorsNameTheSetting) {
  const auto message = [](auto&& make) -> std::string {
    try {
      make();
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  CameraSensorCfg cfg = camera(4, 3, {"rgbd"});
  EXPECT_THAT(message([&] { cfg.build(); }),
              HasSubstr("data_types is 'rgbd': must be one of rgb, depth"));
  cfg.data_types = {};
  EXPECT_THAT(message([&] { cfg.build(); }), HasSubstr("data_types is empty"));
  cfg = camera(4, 3, {"rgb"}, "w/tpo");
  EXPECT_THAT(message([&] { CameraLab(kCases, {cfg}); }),
              HasSubstr("no camera named 'w/tpo'; did you mean 'w/top'?"));
  cfg = camera(4, 3, {"rgb"});
  cfg.name = "w/top";
  EXPECT_THAT(message([&] { CameraLab(kCases, {cfg}); }), HasSubstr("repeated name"));
  cfg.name = "cam";
  cfg.parent_body = "w/none";
  EXPECT_THAT(message([&] { CameraLab(kCases, {cfg}); }), HasSubstr("no body named 'w/none'"));
  cfg = camera(0, 3, {"rgb"});
  EXPECT_THAT(message([&] { cfg.build(); }), HasSubstr("width is 0: must be between 1 and 16384"));
  const auto with = [&](auto change, std::string wrapped = "") {
    CameraSensorCfg c = camera(4, 3, {"rgb", "depth"}, std::move(wrapped));
    change(c);
    return message([&] { CameraLab(kCases, {c}); });
  };
  using Cfg = CameraSensorCfg;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  EXPECT_THAT(with([](Cfg& c) { c.near = kInf; }), HasSubstr("near is inf"));
  EXPECT_THAT(with([](Cfg& c) { c.update_period = kInf; }), HasSubstr("update_period is inf"));
  EXPECT_THAT(with([](Cfg& c) { c.phase = 1; }), HasSubstr("there is no update_period"));
  EXPECT_THAT(with([](Cfg& c) { c.pos[0] = kNan; }), HasSubstr("must be finite"));
  EXPECT_THAT(with([](Cfg& c) { c.quat = {0, 0, 0, 0}; }), HasSubstr("quat is"));
  EXPECT_THAT(with([](Cfg& c) { c.enabled_geom_groups.clear(); }), HasSubstr("is empty"));
  EXPECT_THAT(with([](Cfg& c) {
                c.intrinsics = {1, 1, kNan, 1};
              }),
              HasSubstr("intrinsics: cx is nan: must be finite"));
  EXPECT_THAT(with([](Cfg& c) {
                c.intrinsics = {1, 1, 1, 1};
                c.fovy = 60;
              }),
              HasSubstr("both fovy and intrinsics"));
  EXPECT_THAT(with([&](Cfg& c) { c.distortion = {"fisheye", {kNan, 0, 0, 0}}; }), HasSubstr("nan"));
  EXPECT_THAT(with([](Cfg& c) { c.pos = {1, 2, 3}; }, "w/top"), HasSubstr("keeps its pose"));
  EXPECT_THAT(with([](Cfg& c) { c.fovy = 200; }, "w/top"), HasSubstr("less than 180"));
  // An ideal fisheye of this focal length would see directions behind the camera in the corners.
  EXPECT_THAT(with([](Cfg& c) {
                c.intrinsics = {1, 1, 2, 1.5};
                c.distortion = {"fisheye", {0, 0, 0, 0}};
              }),
              HasSubstr("fx 1 now, 2 or more"));
}

}  // namespace
}  // namespace mjsense::sensors
