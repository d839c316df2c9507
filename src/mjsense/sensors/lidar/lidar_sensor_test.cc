// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/lidar/lidar_sensor.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/lidar/npy.h"
#include "mjsense/sensors/lidar/point_cloud.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::Each;
using ::testing::FloatNear;
using ::testing::HasSubstr;

// A puck that slides along x without friction, inside a ball of radius 5 m and grey 0.5.
constexpr char kRoom[] = R"(
<mujoco><option gravity="0 0 0"/><worldbody>
  <geom name="room" type="sphere" size="5" rgba=".5 .5 .5 1" contype="0" conaffinity="0"/>
  <geom name="wall" type="box" size=".5 20 20" pos="4.5 0 0" group="1" contype="0" conaffinity="0"/>
  <body name="puck"><joint name="x" type="slide" axis="1 0 0"/><joint name="turn" type="hinge" axis="0 0 1"/>
    <geom size=".05" mass="1" group="2"/><site name="lidar"/></body>
</worldbody></mujoco>)";

struct LidarLab : testing::Lab {
  std::shared_ptr<LidarSensorCfg> cfg = std::make_shared<LidarSensorCfg>();

  LidarLab() {
    cfg->name = "lidar";
    cfg->frame = {{"site", "lidar", "r"}};
    cfg->include_geom_groups = {{0}};
    cfg->scan = SpinningScan{.channels = 4, .samples = 90};
  }
  void start(sim::SimulationCfg sim_cfg = {}) {
    scene::SceneCfg s = scene_of("r", kRoom, {cfg});
    s.options.gravity = {0, 0, 0};
    Lab::operator=(Lab(std::move(s), sim_cfg));
  }
  std::vector<float> read(std::string_view field) { return Lab::read(field, "lidar"); }
  void set(const char* component, int i, double value) {
    const ArrayView v = sim->worlds().state_component(component);
    reinterpret_cast<double*>(v.data)[i] = value;
  }
};

TEST(Lidar, RoundRoomIsEquallyFarEverywhere) {
  LidarLab lab;
  lab.start();
  EXPECT_THAT(lab.read("distances"), Each(FloatNear(5, 1e-5f)));
  EXPECT_THAT(lab.read("intensity"), Each(FloatNear(0.5f, 1e-5f)));
  const std::vector<float> p = lab.read("points");
  // Channel 3 (15 degrees up), firing 0 along +x; channel 0, firing 45 along -x.
  EXPECT_NEAR(p[3 * 270], 5 * std::cos(15 * mjPI / 180), 1e-5);
  EXPECT_NEAR(p[3 * 270 + 2], 5 * std::sin(15 * mjPI / 180), 1e-5);
  EXPECT_NEAR(p[3 * 45], -5 * std::cos(15 * mjPI / 180), 1e-5);
  EXPECT_NEAR(p[3 * 45 + 2], -5 * std::sin(15 * mjPI / 180), 1e-5);
}

//   [red, own colour]   lidar at the origin   [material over own colour]
// Intensity is the mean of red, green and blue times the cosine of incidence.
TEST(Lidar, IntensityIsAlbedoTimesCosine) {
  LidarLab lab;
  constexpr char kWalls[] =
      R"(<mujoco><asset><material name="m" rgba=".2 .4 .9 1"/></asset><worldbody>
    <geom type="box" size=".1 9 9" pos="-2.1 0 0" rgba=".9 .1 .2 1"/>
    <geom type="box" size=".1 9 9" pos="3.1 0 0" rgba="1 1 1 1" material="m"/>
    <body name="mast"><site name="lidar"/></body></worldbody></mujoco>)";
  lab.cfg->include_geom_groups = {{0}};
  lab.cfg->max_distance = 8;
  lab.cfg->scan = SpinningScan{.channels = 1, .elevations_deg = {0}, .samples = 8};
  scene::SceneCfg s;
  s.entities.emplace_back("r", scene::EntityCfg{.model = {.xml = kWalls}});
  s.sensors = {lab.cfg};
  lab.scene = std::make_shared<scene::Scene>(std::move(s));
  lab.sim = std::make_unique<sim::Simulation>(lab.scene, sim::SimulationCfg{});
  const std::vector<float> intensity = lab.read("intensity"), distance = lab.read("distances"),
                           points = lab.read("points");
  const double h = std::sqrt(0.5);
  const double material = (.2 + .4 + .9) / 3, own = (.9 + .1 + .2) / 3;
  // Rays at 0, 45, 90 ... 315 degrees; those at 90 and 270 hit nothing.
  const double expected[8] = {material, material * h, 0, own * h, own, own * h, 0, material * h};
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(intensity[i], expected[i], 1e-6) << i;
  for (int i : {2, 6}) {
    EXPECT_EQ(distance[i], -1);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(points[3 * i + k], 0) << i;  // no point at max_distance
  }
  EXPECT_NEAR(points[0], 3, 1e-6);
  EXPECT_NEAR(points[3 * 4], -2, 1e-6);
}

// There is no element of a geom to read, and every ray misses.
TEST(Lidar, SeesNothingInASceneWithoutGeoms) {
  LidarLab lab;
  lab.cfg->frame = {{"site", "s", ""}};
  lab.cfg->scan = SpinningScan{.channels = 2, .elevations_deg = {-10, 10}, .samples = 21};
  scene::SceneCfg s;
  s.base = {.xml = "<mujoco><worldbody><site name='s' pos='1 2 3'/></worldbody></mujoco>"};
  s.sensors = {lab.cfg};
  lab.scene = std::make_shared<scene::Scene>(std::move(s));
  lab.sim = std::make_unique<sim::Simulation>(lab.scene, sim::SimulationCfg{});
  EXPECT_THAT(lab.read("distances"), Each(-1));
  EXPECT_THAT(lab.read("intensity"), Each(0));
  EXPECT_THAT(lab.read("points"), Each(0));
}

// A return that noise moves above max_distance or below min_distance is lost.
TEST(Lidar, NoiseLeavesNoReturnBeyondTheRange) {
  LidarLab lab;
  lab.cfg->range_noise_std = 0.05;
  lab.cfg->min_distance = 0.5;
  lab.cfg->max_distance = 5.02;  // the room is at 5 m
  lab.start();
  lab.sim->step();
  const std::vector<float> d = lab.read("distances"), p = lab.read("points"),
                           hit = lab.read("hit_pos_w"), intensity = lab.read("intensity");
  int lost = 0;
  for (std::size_t i = 0; i < d.size(); ++i) {
    const double length =
        std::sqrt(p[3 * i] * p[3 * i] + p[3 * i + 1] * p[3 * i + 1] + p[3 * i + 2] * p[3 * i + 2]);
    if (d[i] >= 0) {
      EXPECT_LE(d[i], 5.02f);
      EXPECT_NEAR(length, d[i], 1e-5);
      EXPECT_NEAR(intensity[i], 0.5, 1e-5);
      continue;
    }
    ++lost;
    EXPECT_EQ(d[i], -1);
    EXPECT_EQ(length, 0);
    EXPECT_EQ(intensity[i], 0);
    EXPECT_EQ(hit[3 * i], 0);  // the ray's origin
  }
  // P(noise > 0.02 m) = P(z > 0.4) = 0.345
  const double n = static_cast<double>(d.size());
  EXPECT_NEAR(lost / n, 0.345, 4 * std::sqrt(0.345 * 0.655 / n));
}

TEST(Lidar, UsesTheGivenElevations) {
  LidarLab lab;
  lab.cfg->scan = SpinningScan{.channels = 3, .elevations_deg = {-40, 3, 60}, .samples = 1};
  lab.start();
  const std::vector<float> p = lab.read("points");
  for (int c = 0; c < 3; ++c) {
    const double degrees[] = {-40, 3, 60};
    EXPECT_NEAR(p[3 * c + 2], 5 * std::sin(degrees[c] * mjPI / 180), 1e-5);
  }
}

TEST(Lidar, RaysOfAFrameOnTheWorldBodyHitTheWorld) {
  LidarLab lab;
  lab.cfg->frame = {{"body", "world", ""}};
  lab.start();
  EXPECT_THAT(lab.read("distances"), Each(FloatNear(5, 1e-5f)));
}

TEST(Lidar, NoiseHasItsDeviationAndDependsOnTheSeedOnly) {
  const auto run = [](int threads, int worlds, std::uint64_t seed) {
    LidarLab lab;
    lab.cfg->range_noise_std = 0.03;
    lab.cfg->range_noise_relative = 0.008;  // 0.04 m at 5 m: 0.05 m in total
    lab.cfg->dropout = 0.1;
    lab.start({.num_worlds = worlds, .threads = threads, .seed = seed});
    lab.sim->step(2);
    return lab.read("distances");
  };
  const std::vector<float> d = run(1, 8, 1);
  double sum = 0, squares = 0;
  int n = 0;
  for (float x : d) {
    if (x < 0) continue;
    ++n;
    sum += x - 5;
    squares += (x - 5) * (x - 5);
  }
  EXPECT_NEAR(n, 0.9 * d.size(), 4 * std::sqrt(0.09 * d.size()));
  EXPECT_NEAR(sum / n, 0, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.05, 0.003);
  EXPECT_EQ(run(5, 8, 1), d);
  const std::vector<float> alone = run(1, 1, 1);
  EXPECT_TRUE(std::equal(alone.begin(), alone.end(), d.begin()));
  EXPECT_NE(run(1, 8, 2), d);
}

TEST(Lidar, MotionDistortsTheSweep) {
  LidarLab lab;
  lab.cfg->include_geom_groups = {{1}};  // the wall at x = 4
  lab.cfg->motion_distortion = true;
  // One laser that always points along +x. In a spinning scan an azimuth span of nearly 0 would
  // take no time, so this is a table.
  lab.cfg->scan =
      TableScan{.angles = std::vector<std::array<double, 2>>(101, {0.0, 0.0}), .rate_hz = 10};
  lab.start();
  lab.set("qvel", 0, 2.0);
  for (int i = 0; i < 250; ++i) lab.sim->step();  // 0.5 s: at x = 1
  const std::vector<float> d = lab.read("distances");
  for (int i = 0; i <= 100; ++i) {
    const double before = (i - 100) / 1010.0;  // s
    EXPECT_NEAR(d[i], 4 - (1 + 2 * before), 1e-4) << i;
  }
  const std::vector<float> hit = lab.read("hit_pos_w");
  EXPECT_NEAR(hit[0], 4, 1e-5);
}

TEST(Lidar, NoiseMovesDistortedReturnsAlongTheirOwnRays) {
  const auto run = [](auto change) {
    LidarLab lab;
    lab.cfg->motion_distortion = true;
    change(*lab.cfg);
    lab.start();
    lab.set("qvel", 0, 4.0);
    lab.set("qvel", 1, 2.0);
    for (int i = 0; i < 200; ++i) lab.sim->step();
    return std::pair{lab.read("hit_pos_w"), lab.read("distances")};
  };
  const auto [clean, far] = run([](LidarSensorCfg&) {});
  const auto [noisy, measured] = run([](LidarSensorCfg& c) { c.range_noise_std = 0.5; });
  const auto [origins, lost] = run([](LidarSensorCfg& c) { c.dropout = 1; });
  EXPECT_THAT(lost, Each(-1.0f));
  EXPECT_GT(std::abs(origins[0] - origins[3 * 89]), 0.3);  // 0.1 s at 4 m/s
  for (std::size_t r = 0; r < far.size(); ++r)
    for (int k = 0; k < 3; ++k) {
      const float o = origins[3 * r + k], ray = (clean[3 * r + k] - o) / far[r];
      ASSERT_NEAR(noisy[3 * r + k], o + measured[r] * ray, 1e-4) << r;
    }
}

TEST(Lidar, BeforeTheFirstPoseTheFrameIsAtRest) {
  LidarLab lab;
  lab.cfg->include_geom_groups = {{1}};
  lab.cfg->motion_distortion = true;
  lab.start();
  lab.set("qpos", 0, 1.0);
  lab.sim->forward();
  const std::vector<float> d = lab.read("distances");
  EXPECT_NEAR(d[2 * 90], 3 / std::cos(5 * mjPI / 180), 1e-5);
  EXPECT_NEAR(d[2 * 90 + 45], -1, 0);
}

// A frame that is moved when an episode begins was not moving during the sweep before.
TEST(Lidar, ResetClearsThePoseHistory) {
  LidarLab lab;
  lab.cfg->include_geom_groups = {{1}};  // the wall at x = 4
  lab.cfg->motion_distortion = true;
  lab.cfg->scan =
      TableScan{.angles = std::vector<std::array<double, 2>>(11, {0.0, 0.0}), .rate_hz = 10};
  lab.start();
  for (int i = 0; i < 100; ++i) lab.sim->step();
  EXPECT_THAT(lab.read("distances"), Each(FloatNear(4, 1e-4f)));
  lab.set("qpos", 0, 1.0);
  lab.sim->reset_sensors();  // the time is not reset
  EXPECT_THAT(lab.read("distances"), Each(FloatNear(3, 1e-4f)));
}

TEST(Lidar, TableAdvancesWithEveryScan) {
  LidarLab lab;
  std::vector<std::array<double, 2>> angles;
  for (int i = 0; i < 30; ++i) angles.push_back({0.01 * i, 0.0});
  lab.cfg->scan = TableScan{.angles = angles, .rays_per_scan = 10, .rate_hz = 100};
  lab.start({.decimation = 5});  // 0.01 s per step: one scan per step
  for (int step = 0; step < 5; ++step) {
    const std::vector<float> p = lab.read("points");
    EXPECT_NEAR(std::atan2(p[1], p[0]), 0.1 * (step % 3), 1e-5) << step;
    lab.sim->step();
  }
}

TEST(Lidar, ErrorsNameTheSetting) {
  const auto with = [](auto change) -> std::string {
    LidarLab lab;
    change(*lab.cfg);
    return error_of([&] { lab.start(); });
  };
  using Cfg = LidarSensorCfg;
  EXPECT_THAT(with([](Cfg& c) { c.dropout = 2; }), HasSubstr("sensor 'lidar': dropout is 2"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = SpinningScan{.channels = 2, .elevations_deg = {1}}; }),
              HasSubstr("elevations_deg has 1 value, channels is 2"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = TableScan{}; }), HasSubstr("no rows"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = TableScan{.file = "nowhere.npy"}; }),
              HasSubstr("sensor 'lidar': scan table 'nowhere.npy': cannot be opened"));
  EXPECT_THAT(with([](Cfg& c) {
                c.scan = TableScan{.file = "nowhere.npy", .angles = {{0, 0}}};
              }),
              HasSubstr("give one of them"));
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(with([](Cfg& c) {
                c.scan = TableScan{.angles = {{0, 0}, {0, kNan}}};
              }),
              HasSubstr("scan: angles[1][1] is nan: must be finite"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = SpinningScan{.elevation_max_deg = 120}; }),
              HasSubstr("elevation_max_deg is 120"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = SpinningScan{.azimuth_start_deg = kNan}; }),
              HasSubstr("azimuth_start_deg is nan"));
  EXPECT_THAT(with([](Cfg& c) { c.scan = SpinningScan{.channels = 100000, .samples = 100000}; }),
              HasSubstr("10000000000 rays: the maximum is"));
  EXPECT_THAT(with([](Cfg& c) {
                c.scan = SpinningScan{.rate_hz = 1e-9};
                c.motion_distortion = true;
              }),
              HasSubstr("stored poses"));
  EXPECT_THAT(with([](Cfg& c) { c.pattern = RingPattern{}; }), HasSubstr("use scan"));
  EXPECT_THAT(with([](Cfg& c) { c.range_noise_std = -1; }), HasSubstr("range_noise_std"));
}

TEST(Npy, ReadsFloatPairsAndRefusesOthers) {
  const testing::TempDir dir;
  const std::string path = dir.file("pairs.npy");
  const auto write = [&](std::string dict, std::vector<float> values) {
    dict.resize(118, ' ');
    std::ofstream out(path, std::ios::binary);
    out.write("\x93NUMPY\x01\x00\x76\x00", 10);
    out << dict;
    out.write(reinterpret_cast<const char*>(values.data()),
              static_cast<std::streamsize>(values.size() * 4));
  };
  write("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), }", {1, 2, 3, 4});
  EXPECT_EQ(read_npy_pairs(path, "here"), (std::vector<std::array<double, 2>>{{1, 2}, {3, 4}}));
  write("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }", {1, 2, 3, 4});
  EXPECT_THROW(read_npy_pairs(path, "here"), RuntimeError);
  write("{'descr': '<i4', 'fortran_order': False, 'shape': (2, 2), }", {1, 2, 3, 4});
  EXPECT_THROW(read_npy_pairs(path, "here"), RuntimeError);
  write("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", {1, 2, 3, 4, 5, 6});
  EXPECT_THROW(read_npy_pairs(path, "here"), RuntimeError);
  // Headers that claim more than fits into memory, and one that ends where a value should begin.
  for (const char* rows : {"400000000000", "4611686018427387904", "9223372036854775807"}) {
    write(fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 2), }}", rows), {});
    EXPECT_THROW(read_npy_pairs(path, "here"), RuntimeError) << rows;
  }
  write("{'descr': '<f8', 'fortran_order': False, 'shape':", {1, 2});
  EXPECT_THROW(read_npy_pairs(path, "here"), RuntimeError);
}

TEST(PointCloud, OmitsPointsWithoutAReturn) {
  const testing::TempDir dir;
  const std::string path = dir.file("cloud.ply");
  const float points[] = {1, 2, 3, 0, 0, 0, 4, 5, 6}, intensity[] = {0.5f, 0, 1},
              distances[] = {3, -1, 8};
  write_point_cloud(path, points, intensity, distances);
  std::ifstream in(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_THAT(text, HasSubstr("element vertex 2\n"));
  const std::size_t body = text.find("end_header\n") + 11;
  ASSERT_EQ(text.size() - body, 32u);
  float last[4];
  std::memcpy(last, text.data() + body + 16, 16);
  EXPECT_EQ(last[2], 6);
  EXPECT_EQ(last[3], 1);
  EXPECT_THROW(write_point_cloud("cloud.xyz", points), ValueError);
}

}  // namespace
}  // namespace mjsense::sensors
