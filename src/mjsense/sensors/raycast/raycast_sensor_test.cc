// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/raycast_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using testing::kOnItsSide;
using ::testing::Pointwise;

// A floor, a step 0.5 m high for x > 0.5, a floating base with a child body below it, and geoms in
// other groups.
constexpr char kRobot[] = R"(
<mujoco>
  <asset><material name="rock" rgba=".5 .5 .5 1"/><material name="glass" rgba="1 1 1 0"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1" material="rock"/>
    <geom name="step" type="box" size="1 2 .225" pos="1.5 0 .275"/>
    <geom name="window" type="box" size=".1 .1 .1" pos="-3 0 1" material="glass"/>
    <geom name="hidden" type="box" size=".1 .1 .1" pos="-4 0 1" group="3"/>
    <camera name="eye" pos="0 0 2" resolution="4 3" fovy="60"/>
    <camera name="map" pos="0 0 2" resolution="4 3" fovy="2" projection="orthographic"/>
    <body name="base" pos="0 0 2">
      <freejoint name="root"/>
      <geom name="shell" type="box" size=".2 .2 .1" mass="1"/>
      <site name="scan" pos="0 0 -.05" euler="0 0 90"/>
      <body name="belly" pos="0 0 -.5"><geom name="ball" type="sphere" size=".05" mass=".1"/></body>
    </body>
  </worldbody>
</mujoco>)";

template <class Cfg>
std::shared_ptr<Cfg> sensor_cfg(std::string name = "ray") {
  auto cfg = std::make_shared<Cfg>();
  cfg->name = std::move(name);
  cfg->frame = {{"body", "base", "r"}};
  cfg->pattern = GridPattern{.size = {0, 0}};
  return cfg;
}

struct RayLab : testing::Lab {
  explicit RayLab(std::vector<std::shared_ptr<const SensorCfg>> sensors,
                  sim::SimulationCfg cfg = {})
      : Lab("r", kRobot, std::move(sensors), cfg) {}

  template <class T = float>
  std::vector<T> read(std::string_view field, std::string_view name = "ray") {
    return Lab::read<T>(field, name);
  }
};

// Errors that do not depend on the model are found by build().
TEST(RayCast, InvalidConfigurationsAreRefusedAtBuild) {
  const auto message = [](auto change) -> std::string {
    const auto cfg = sensor_cfg<RayCastSensorCfg>();
    change(*cfg);
    return error_of([&] { cfg->build(); });
  };
  using Cfg = RayCastSensorCfg;
  EXPECT_EQ(message([](Cfg&) {}), "");
  EXPECT_THAT(message([](Cfg& c) { c.pattern = GridPattern{.resolution = 0}; }),
              HasSubstr("sensor 'ray': pattern: resolution is 0: must be above 0"));
  EXPECT_THAT(message([](Cfg& c) { c.pattern = PinholePattern{.fovy = 180}; }), HasSubstr("fovy"));
  EXPECT_THAT(message([](Cfg& c) { c.pattern = RingPattern{.include_center = false}; }),
              HasSubstr("no rays"));
  EXPECT_THAT(message([](Cfg& c) { c.pattern = UserPattern{.times = {1}}; }),
              HasSubstr("times[0] is 1: must be at most 0"));
  EXPECT_EQ(message([](Cfg& c) { c.pattern = PinholePattern::from_mujoco_camera("eye"); }), "");
  EXPECT_THAT(message([](Cfg& c) { c.frame[0].type = "goem"; }), HasSubstr("is a 'goem'"));
  EXPECT_THAT(message([](Cfg& c) { c.viz.ray_width = -1; }), HasSubstr("ray_width is -1"));
}

TEST(RayCast, SeesItsChildButNotItself) {
  RayLab lab({sensor_cfg<RayCastSensorCfg>()});
  EXPECT_THAT(lab.read("distances"), ElementsAre(FloatNear(0.45f, 1e-6f)));
  EXPECT_THAT(lab.read("normals_w"), Pointwise(FloatNear(1e-6f), {0.0f, 0.0f, 1.0f}));
  EXPECT_THAT(lab.read("hit_pos_w"), Pointwise(FloatNear(1e-6f), {0.0f, 0.0f, 1.55f}));
  const mjModel* m = lab.sim->model();
  EXPECT_EQ(lab.read<int>("geom_id")[0], mj_name2id(m, mjOBJ_GEOM, "r/ball"));
  EXPECT_EQ(lab.read<int>("body_id")[0], mj_name2id(m, mjOBJ_BODY, "r/belly"));
  EXPECT_EQ(lab.read<int>("material_id")[0], -1);
}

TEST(RayCast, CanSeeItselfFromInside) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->exclude_parent_body = false;
  RayLab lab({cfg});
  EXPECT_THAT(lab.read("distances"), ElementsAre(FloatNear(0.1f, 1e-6f)));
  EXPECT_THAT(lab.read("normals_w"), Pointwise(FloatNear(1e-6f), {0.0f, 0.0f, -1.0f}));
}

TEST(RayCast, MissReportsTheOrigin) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->pattern = GridPattern{.size = {0, 0}, .direction = {0, 0, 1}};
  RayLab lab({cfg});
  lab.pose({-1, 2, 3, 1, 0, 0, 0});
  EXPECT_THAT(lab.read("distances"), ElementsAre(-1.0f));
  EXPECT_THAT(lab.read("normals_w"), Each(0.0f));
  EXPECT_THAT(lab.read("hit_pos_w"), ElementsAre(-1.0f, 2.0f, 3.0f));
  EXPECT_THAT(lab.read<int>("geom_id"), ElementsAre(-1));
}

TEST(RayCast, DistancesAtBothLimitsCount) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->ray_alignment = "world";
  cfg->max_distance = 2.1;
  cfg->min_distance = 1.9;
  RayLab lab({cfg});
  const auto distance = [&](double z) {
    // The base is on its side, so that its child is not below it.
    lab.pose({-10, 0, z, kOnItsSide, kOnItsSide, 0, 0});
    return lab.read("distances")[0];
  };
  EXPECT_FLOAT_EQ(distance(2.1), 2.1f);
  EXPECT_FLOAT_EQ(distance(1.9), 1.9f);
  EXPECT_FLOAT_EQ(distance(2.10001), -1.0f);
  EXPECT_FLOAT_EQ(distance(1.89999), -1.0f);
}

TEST(RayCast, AlignmentTurnsRaysButNotTheFrame) {
  std::vector<std::shared_ptr<const SensorCfg>> cfgs;
  for (RayAlignment alignment : {RayAlignment::kBase, RayAlignment::kYaw, RayAlignment::kWorld}) {
    auto cfg = sensor_cfg<RayCastSensorCfg>(std::string(enum_name(alignment)).c_str());
    cfg->frame = {{"site", "scan", "r"}};  // rotated by 90 degrees about z
    cfg->pattern = UserPattern{{{0.3, 0, 0}}, {{0, 0, -2}}};
    cfg->ray_alignment = alignment;
    cfgs.push_back(cfg);
  }
  RayLab lab(cfgs);
  const double c = std::cos(0.1), s = std::sin(0.1);
  lab.pose({-2, 0, 2, c, 0, s, 0});  // pitched by 0.2 rad
  const std::vector<float> base = lab.read("hit_pos_w", "base"), yaw = lab.read("hit_pos_w", "yaw"),
                           world = lab.read("hit_pos_w", "world");
  const double x = -2 - 0.05 * std::sin(0.2), z = 2 - 0.05 * std::cos(0.2);
  EXPECT_THAT(base, Pointwise(FloatNear(1e-5f), {float(x - z * std::tan(0.2)), 0.3f, 0.0f}));
  EXPECT_THAT(yaw, Pointwise(FloatNear(1e-5f), {float(x), 0.3f, 0.0f}));
  EXPECT_THAT(world, Pointwise(FloatNear(1e-5f), {float(x + 0.3), 0.0f, 0.0f}));
  EXPECT_EQ(lab.read("quat_w", "world"), lab.read("quat_w", "base"));
}

// A frame that points up still has a heading. The heading does not flip where the frame's x axis
// passes the vertical.
TEST(RayCast, HeadingDoesNotFlipAtTheVertical) {
  const double heading = 0.7;
  for (double pitch : {-1.3, -M_PI / 2 + 0.05, -M_PI / 2, -M_PI / 2 - 0.05, M_PI / 2 + 0.05}) {
    double yaw[4], nose[4], q[4], mat[9];
    const double z[3] = {0, 0, 1}, y[3] = {0, 1, 0};
    mju_axisAngle2Quat(yaw, z, heading);
    mju_axisAngle2Quat(nose, y, pitch);
    mju_mulQuat(q, yaw, nose);
    mju_quat2Mat(mat, q);
    float out[9];
    align_rays(RayAlignment::kYaw, mat, out);
    const float c = static_cast<float>(std::cos(heading)),
                s = static_cast<float>(std::sin(heading));
    EXPECT_THAT(std::vector<float>(out, out + 9),
                Pointwise(FloatNear(1e-6f), std::vector<float>{c, -s, 0, s, c, 0, 0, 0, 1}))
        << pitch;
  }
}

// Of the two quaternions of an orientation, the one whose largest component is positive is
// returned.
TEST(RayCast, LargestComponentOfAQuaternionIsPositive) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->frame = {{"body", "base", "r"}, {"body", "belly", "r"}};
  RayLab lab({cfg});
  const auto expect = [&](std::initializer_list<double> unnormalised) {
    double q[4];
    std::copy(unnormalised.begin(), unnormalised.end(), q);
    mju_normalize4(q);
    lab.pose({0, 0, 2, q[0], q[1], q[2], q[3]});
    int largest = 0;
    for (int i = 1; i < 4; ++i) largest = std::abs(q[i]) > std::abs(q[largest]) ? i : largest;
    const float sign = q[largest] < 0 ? -1.0f : 1.0f;
    std::vector<float> one;
    for (double x : q) one.push_back(sign * static_cast<float>(x));
    EXPECT_THAT(lab.read("quat_w"), Pointwise(FloatNear(1e-6f), one));
    std::vector<float> both = one;
    both.insert(both.end(), one.begin(), one.end());
    EXPECT_THAT(lab.read("frame_quat_w"), Pointwise(FloatNear(1e-6f), both));
  };
  expect({1, 0, 0, 0});
  expect({-1, 0, 0, 0});
  expect({.6, -.7, .3, .2});  // w is above 1/2, but it is not the largest
  expect({.6, .1, -.75, .2});
  expect({.55, .1, .2, -.8});
  expect({-.1, .2, .3, -.9});
  for (int k = 0; k < 200; ++k) {  // quaternions in all directions
    const double a = 0.7 * k, b = 1.3 * k, c = 0.05 * k;
    expect({std::cos(a) * std::cos(c), std::sin(a) * std::cos(c), std::cos(b) * std::sin(c),
            std::sin(b) * std::sin(c)});
  }
}

TEST(RayCast, GroupsAndTransparencyBelongToTheQuery) {
  auto seen = sensor_cfg<RayCastSensorCfg>("default"),
       third = sensor_cfg<RayCastSensorCfg>("third");
  third->include_geom_groups = {{3}};
  seen->ray_alignment = third->ray_alignment = "world";
  RayLab lab({seen, third});
  lab.pose({-4, 0, 2, kOnItsSide, kOnItsSide, 0, 0});
  EXPECT_FLOAT_EQ(lab.read("distances", "default")[0], 2.0f);
  EXPECT_FLOAT_EQ(lab.read("distances", "third")[0], 0.9f);
  lab.pose({-3, 0, 2, kOnItsSide, kOnItsSide, 0, 0});
  EXPECT_FLOAT_EQ(lab.read("distances", "default")[0], 2.0f) << "glass of alpha 0";
  EXPECT_FLOAT_EQ(lab.read("distances", "third")[0], -1.0f);
}

TEST(RayCast, AcceptsCamerasAndSeveralFrames) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->any_frame = true;
  cfg->frame = {{"camera", "eye", "r"}, {"xbody", "belly", "r"}};
  cfg->pattern = PinholePattern::from_mujoco_camera("r/eye");
  cfg->exclude_parent_body = false;  // the camera and the floor both belong to the world body
  RayLab lab({cfg});
  lab.pose({-10, 0, 5, 1, 0, 0, 0});
  const std::vector<float> d = lab.read("distances");
  ASSERT_EQ(d.size(), 24u);
  // Corner ray of the camera: (-tan_h, -tan_v, -1) from 2 m above the floor.
  const double tan_v = std::tan(30 * mjPI / 180), tan_h = tan_v * 4 / 3;
  EXPECT_NEAR(d[0], 2 * std::sqrt(1 + tan_v * tan_v + tan_h * tan_h), 1e-5);
  EXPECT_NEAR(d[12], 0.05, 1e-6);  // from inside the body's own ball
  EXPECT_THAT(lab.read("frame_pos_w"),
              Pointwise(FloatNear(1e-6f), {0.0f, 0.0f, 2.0f, -10.0f, 0.0f, 4.5f}));
}

TEST(RayCast, TeleportChangesTheNextReadingOfItsWorldOnly) {
  RayLab lab({sensor_cfg<RayCastSensorCfg>()}, {.num_worlds = 3});
  const std::vector<float> before = lab.read("hit_pos_w");
  lab.pose({-7, 1, 9, 1, 0, 0, 0}, 1);
  const std::vector<float> after = lab.read("hit_pos_w");
  for (int i = 0; i < 9; ++i) {
    if (i / 3 == 1) continue;
    EXPECT_EQ(after[i], before[i]);
  }
  EXPECT_NEAR(after[3], -7, 1e-5);
  EXPECT_NEAR(after[5], 8.55, 1e-5);
  const int ids[] = {1};
  lab.sim->reset(ids);
  EXPECT_EQ(lab.read("hit_pos_w"), before);
}

// Height scans of robots at their spawn points, and at random places on the tiles, including seams.
TEST(RayCast, HeightScansOnGeneratedTerrain) {
  constexpr int kWorlds = 96;
  scene::SceneCfg s;
  s.terrain = scene::TerrainCfg{.terrain_type = "generator",
                                .sub_terrains = {{"slope", {.kind = "slope"}},
                                                 {"pit", {.kind = "slope", .inverted = true}},
                                                 {"rough", {.kind = "rough"}},
                                                 {"waves", {.kind = "waves"}}},
                                .levels = 4};
  s.entities.emplace_back(
      "r",
      scene::EntityCfg{.model = {.xml = "<mujoco><worldbody><body name='base'><freejoint/><geom "
                                        "size='.05'/></body></worldbody></mujoco>"}});
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->pattern = GridPattern{.size = {1.6, 1.0}};
  cfg->max_distance = 50;
  s.sensors = {cfg};
  auto scene = std::make_shared<scene::Scene>(std::move(s));
  sim::Simulation sim(scene, {.num_worlds = kWorlds});
  const mjModel* m = sim.model();
  auto& sensor = dynamic_cast<RayCastSensor&>(scene->sensor("ray"));
  const std::vector<double> origins = scene->env_origins(kWorlds);
  const ArrayView qpos = sim.worlds().state_component("qpos");
  const DataPtr data = make_data(m);
  mj_forward(m, data.get());
  Rng rng(1, 0, 0, 0);
  long wrong = 0, rays = 0;
  for (int round = 0; round < 8; ++round) {
    for (int w = 0; w < kWorlds; ++w) {
      double* q = reinterpret_cast<double*>(qpos.data + w * qpos.strides[0]);
      const double astray = round == 0 ? 0 : round == 1 ? 4 : rng.uniform(0, 6);
      for (int k = 0; k < 2; ++k) q[k] = origins[3 * w + k] + astray * (rng.below(3) - 1);
      q[2] = origins[3 * w + 2] + (round == 0 ? 0.3 : 3);
    }
    sim.forward();
    sim.refresh(sensor);
    for (int w = 0; w < kWorlds; ++w) {
      const double* q = reinterpret_cast<const double*>(qpos.data + w * qpos.strides[0]);
      const auto distances = std::as_const(sensor.field("distances").data).row<float>(w);
      for (std::size_t i = 0; i < distances.size(); ++i, ++rays) {
        const auto& at = sensor.pattern().offsets[i];
        const double down[3] = {0, 0, -1};
        // On a seam or the border of a tile, the result of either neighbour is correct.
        bool right = false;
        for (double dx : {0.0, -1e-6, 1e-6})
          for (double dy : {0.0, -1e-6, 1e-6}) {
            const double o[3] = {q[0] + at[0] + dx, q[1] + at[1] + dy, q[2] + at[2]};
            int geom = -1;
            const double truth = mj_ray(m, data.get(), o, down, nullptr, 1, 2, &geom, nullptr);
            right |= std::abs(distances[i] - truth) < 1e-5;
          }
        wrong += !right;
      }
    }
  }
  EXPECT_GT(rays, 100000);
  EXPECT_EQ(wrong, 0);
}

TEST(RayCast, BitEqualAtAnyNumberOfThreadsAndWorlds) {
  const auto run = [](int threads, int worlds) {
    auto cfg = sensor_cfg<RayCastSensorCfg>();
    cfg->pattern = GridPattern{.size = {4, 3}, .resolution = 0.07, .direction = {0.2, 0.1, -1}};
    RayLab lab({cfg}, {.num_worlds = worlds, .threads = threads});
    for (int w = 0; w < worlds; ++w) lab.pose({0.3, 0.1 * w, 2, 0.9, 0.1, 0.2 + 0.01 * w, 0.3}, w);
    lab.sim->step(3);
    return lab.read("distances");
  };
  const std::vector<float> one = run(1, 5), two = run(2, 5), five = run(5, 5), alone = run(1, 1);
  EXPECT_EQ(one, two);
  EXPECT_EQ(one, five);
  EXPECT_TRUE(std::equal(alone.begin(), alone.end(), one.begin()));
}

TEST(RayCast, ErrorsNameSensorFoundAndExpected) {
  const auto with = [](auto change) {
    auto cfg = sensor_cfg<RayCastSensorCfg>();
    change(*cfg);
    return error_of([&] { RayLab lab({cfg}); });
  };
  using Cfg = RayCastSensorCfg;
  EXPECT_THAT(
      with([](Cfg& c) {
        c.frame = {{"camera", "eye", "r"}};
      }),
      HasSubstr("sensor 'ray': frame 'r/eye' is a camera: must be 'body', 'site', or 'geom'"));
  EXPECT_THAT(with([](Cfg& c) { c.frame = {}; }), HasSubstr("no frame"));
  EXPECT_THAT(with([](Cfg& c) {
                c.frame = {{"joint", "root", "r"}};
              }),
              HasSubstr("must be 'body', 'site', or 'geom'"));
  EXPECT_THAT(with([](Cfg& c) { c.frame = {{"site", "scam", "r"}}; }), HasSubstr("scan"));
  EXPECT_THAT(with([](Cfg& c) {
                c.frame = {{"sight", "scan", "r"}};
              }),
              HasSubstr("is a 'sight': must be 'body', 'site', or 'geom'"));
  EXPECT_THAT(with([](Cfg& c) { c.include_geom_groups.emplace(); }), HasSubstr("is empty"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = PinholePattern::from_mujoco_camera("r/map"); }),
              HasSubstr("camera 'r/map' is orthographic"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = UserPattern{.times = {-1e9}}; }),
              HasSubstr("stored poses"));
  EXPECT_THAT(with([](Cfg& c) {
                c.include_geom_groups = {{0, 6}};
              }),
              HasSubstr("include_geom_groups[1] is 6: must be between 0 and 5"));
  EXPECT_THAT(with([](Cfg& c) { c.max_distance = 0; }), HasSubstr("max_distance"));
  EXPECT_THAT(with([](Cfg& c) { c.min_distance = 10; }), HasSubstr("min_distance"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = GridPattern{.resolution = 0}; }),
              HasSubstr("resolution is 0"));
  EXPECT_THAT(with([](Cfg& c) {
                c.pattern = GridPattern{.direction = {0, 0, 0}};
              }),
              HasSubstr("must have a finite length"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = RingPattern{.include_center = false}; }),
              HasSubstr("no rays"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = PinholePattern{.width = 0}; }),
              HasSubstr("at least 1"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = PinholePattern::from_mujoco_camera("r/eyes"); }),
              HasSubstr("r/eye"));
}

TEST(RayCast, DrawsHitsRaysAndNormals) {
  auto cfg = sensor_cfg<RayCastSensorCfg>();
  cfg->pattern = UserPattern{{{0, 0, 0}}, {{0, 0, -1}, {0, 0, 1}}};
  cfg->viz.show_rays = cfg->viz.show_normals = true;
  RayLab lab({cfg});
  EXPECT_TRUE(lab.sim->draw(0).list().empty());  // without debug_vis
  Sensor* sensor[] = {&lab.scene->sensor("ray")};
  const DebugShapes shapes = lab.sim->draw(0, sensor);
  const double unit = lab.sim->model()->stat.meansize;
  const auto expect = [&](int i, mjtGeom kind, const char* label, double z, double dz,
                          double width) {
    const DebugShape& s = shapes.list().at(i);
    EXPECT_EQ(s.kind, kind);
    EXPECT_EQ(s.label, label);
    EXPECT_NEAR(s.pos.z, z, 1e-5);
    EXPECT_NEAR(s.vector.z, dz, 1e-5);
    EXPECT_NEAR(norm(s.vector), std::abs(dz), 1e-5);
    EXPECT_DOUBLE_EQ(s.width, width * unit);
  };
  ASSERT_EQ(shapes.list().size(), 4u);  // the base is at 2 m, with a ball below it at 1.5 m
  expect(0, mjGEOM_SPHERE, "ray_hit_0", 1.55, 0, 0.5);
  expect(1, mjGEOM_ARROW, "ray_ray_0", 2, -0.45, 0.1);
  expect(2, mjGEOM_ARROW, "ray_normal_0", 1.55, 5 * unit, 0.1);
  expect(3, mjGEOM_ARROW, "ray_ray_1", 2, 0.5, 0.1);
  EXPECT_EQ(shapes.list()[3].rgba, cfg->viz.miss_color);
}

TEST(Pattern, GridEndsEarlyIfTheResolutionDoesNotDivide) {
  const RayPattern p =
      make_pattern(GridPattern{.size = {0.5, 0}, .resolution = 0.2}, nullptr, "test");
  ASSERT_EQ(p.size(), 3u);
  EXPECT_DOUBLE_EQ(p.offsets[0][0], -0.25);
  EXPECT_NEAR(p.offsets[2][0], 0.15, 1e-12);
}

TEST(Pattern, RingsCanHaveACentre) {
  const auto offsets = [](bool center) {
    const RingPattern ring{.rings = {{.radius = 0.5, .num_samples = 4}}, .include_center = center};
    std::vector<double> xy;
    for (const auto& o : make_pattern(ring, nullptr, "test").offsets)
      xy.insert(xy.end(), {o[0], o[1]});
    return xy;
  };
  const std::vector<double> ring = {0.5, 0, 0, 0.5, -0.5, 0, 0, -0.5};
  std::vector<double> with_center = {0, 0};
  with_center.insert(with_center.end(), ring.begin(), ring.end());
  EXPECT_THAT(offsets(false), Pointwise(::testing::DoubleNear(1e-12), ring));
  EXPECT_THAT(offsets(true), Pointwise(::testing::DoubleNear(1e-12), with_center));
}

TEST(Pattern, EveryRayIsInExactlyOnePacket) {
  for (int n : {1, 15, 16, 17, 187, 1000}) {
    Rng rng(1, 0, 0, n);
    UserPattern user;
    user.offsets.assign(n, {});
    for (auto& o : user.offsets)
      for (double& x : o) x = rng.uniform(-1, 1);
    const RayBundle bundle(make_pattern(user, nullptr, "test"), 0, n);
    std::vector<int> seen(n, 0);
    for (int p = 0; p < bundle.num_packets(); ++p)
      for (int i = 0; i < rays::kPacket; ++i)
        if (bundle.rays(p)[i] >= 0) ++seen[bundle.rays(p)[i]];
    EXPECT_THAT(seen, Each(1));
    EXPECT_EQ(bundle.num_packets(), (n + 15) / 16);
  }
}

// Adjacent rays, which are copied in one piece, and scattered rays.
TEST(Pattern, LanesAreCopiedToTheirRays) {
  UserPattern strewn;
  strewn.offsets.assign(187, {});
  Rng rng(2, 0, 0, 0);
  for (auto& o : strewn.offsets)
    for (double& x : o) x = rng.uniform(-1, 1);
  for (const PatternCfg& cfg : {PatternCfg(strewn), PatternCfg(GridPattern{{4.0, 0.2}, 0.1})}) {
    const RayPattern pattern = make_pattern(cfg, nullptr, "test");
    const int n = static_cast<int>(pattern.size());
    const RayBundle bundle(pattern, 0, n);
    std::vector<float> want;
    for (int r = 0; r < n; ++r)
      for (int k = 0; k < 3; ++k) want.push_back(10.0f * r + k);
    want.push_back(-1);
    // In both orders, so that a wrong value cannot be overwritten by a right one.
    for (bool back : {false, true}) {
      std::vector<float> rows(3 * n + 1, -1);
      for (int turn = 0; turn < bundle.num_packets(); ++turn) {
        const int p = back ? bundle.num_packets() - 1 - turn : turn;
        float lanes[3 * rays::kPacket];
        for (int i = 0; i < rays::kPacket; ++i)
          for (int k = 0; k < 3; ++k) lanes[3 * i + k] = 10.0f * bundle.rays(p)[i] + k;
        bundle.each_run(p, [&](auto n, int lane, int ray) {
          copy_some<3 * n()>(lanes + 3 * lane, rows.data() + 3 * ray);
        });
      }
      EXPECT_EQ(rows, want);
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
