// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/imu/imu_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/effects/timing.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::HasSubstr;

// A body at rest whose site is rolled by 90 degrees: up is the site's +y.
constexpr char kRest[] = R"(
<mujoco><worldbody><body name="b" pos="0 0 1"><geom size=".1"/><site name="imu" euler="90 0 0"/></body>
</worldbody></mujoco>)";

std::shared_ptr<scene::Scene> make_scene(const ImuSensorCfg& cfg) {
  scene::SceneCfg scene;
  scene::EntityCfg entity;
  entity.model.xml = kRest;
  scene.entities.emplace_back("robot", entity);
  scene.sensors.push_back(std::make_shared<ImuSensorCfg>(cfg));
  return std::make_shared<scene::Scene>(std::move(scene));
}

ImuSensorCfg imu(std::string preset) {
  ImuSensorCfg cfg;
  cfg.name = "imu";
  cfg.site = {"site", "imu", "robot"};
  cfg.preset = std::move(preset);
  return cfg;
}

TEST(Imu, IdealReadsSpecificForceInSiteAxes) {
  auto scene = make_scene(imu("ideal"));
  sim::Simulation sim(scene, {});
  sim.step();
  sim.refresh(scene->sensor("imu"));
  const auto acc = scene->sensor("imu").field("acc").data.row<float>(0);
  EXPECT_NEAR(acc[0], 0, 1e-5);
  EXPECT_NEAR(acc[1], 9.81, 1e-5);
  EXPECT_NEAR(acc[2], 0, 1e-5);
  EXPECT_TRUE(scene->find_sensor("imu_acc"));  // the clean sensor
}

TEST(Imu, ErrorsHaveTheStatisticsOfTheDataSheet) {
  auto scene = make_scene(imu("mpu6050"));
  sim::SimulationCfg cfg;
  cfg.num_worlds = 256;
  cfg.decimation = 5;  // 10 ms per step
  sim::Simulation sim(scene, cfg);
  const double deg = std::numbers::pi / 180;
  double bias2 = 0, noise2 = 0;
  int n = 0;
  std::vector<double> sum(cfg.num_worlds), sum2(cfg.num_worlds);
  constexpr int kSteps = 100;
  for (int k = 0; k < kSteps; ++k) {
    sim.step();
    sim.refresh(scene->sensor("imu"));
    for (int w = 0; w < cfg.num_worlds; ++w) {
      const double x = scene->sensor("imu").field("gyro").data.row<float>(w)[0];
      EXPECT_NEAR(x * 16.4 / deg, std::round(x * 16.4 / deg), 0.01);  // multiples of the resolution
      sum[w] += x;
      sum2[w] += x * x;
    }
  }
  for (int w = 0; w < cfg.num_worlds; ++w) {
    const double mean = sum[w] / kSteps;
    bias2 += mean * mean;
    noise2 += (sum2[w] - kSteps * mean * mean) / (kSteps - 1);
    ++n;
  }
  EXPECT_NEAR(std::sqrt(bias2 / n) / deg, 20.0 / 3, 1.3);
  // 0.005 deg/s/sqrt(Hz) at 100 Hz, and the rounding to counts with variance step^2 / 12.
  const double expected = std::hypot(0.005 / std::sqrt(0.01), 1 / 16.4 / std::sqrt(12));
  EXPECT_NEAR(std::sqrt(noise2 / n) / deg, expected, 0.05 * expected);
}

// In a new episode the filters contain nothing of the last one. Other worlds are not affected.
TEST(Imu, ResetClearsTheFiltersOfItsWorldsOnly) {
  constexpr char kTop[] = R"(<mujoco><option gravity="0 0 0"/><worldbody><body><joint axis="0 0 1"/>
    <geom size=".1"/><site name="imu"/></body></worldbody></mujoco>)";
  ImuSensorCfg cfg = imu("");
  auto delay = std::make_shared<effects::Delay>(0.05);  // 5 rows
  cfg.effects = {delay};
  cfg.model.gyroscope.bias_tolerance = {0.3, 0.6, 0.9};
  scene::SceneCfg scene_cfg;
  scene_cfg.entities.emplace_back("robot", scene::EntityCfg{.model = {.xml = kTop}});
  scene_cfg.sensors.push_back(std::make_shared<ImuSensorCfg>(cfg));
  auto scene = std::make_shared<scene::Scene>(std::move(scene_cfg));
  sim::Simulation sim(scene, {.num_worlds = 2, .decimation = 5});  // 10 ms per step
  const auto spin = [&](int world, double speed) {
    const ArrayView v = sim.worlds().state_component("qvel");
    *reinterpret_cast<double*>(v.data + world * v.strides[0]) = speed;
  };
  const auto gyro = [&](int world) {
    sim.refresh(scene->sensor("imu"));
    const auto row = scene->sensor("imu").field("gyro").data.row<float>(world);
    return std::array<float, 3>{row[0], row[1], row[2]};
  };
  for (int w : {0, 1}) spin(w, 5);
  sim.forward();
  sim.step(20);
  const auto zero = gyro(0), one = gyro(1);
  EXPECT_NEAR(zero[2], 5, 4 * 0.3);
  EXPECT_NE(zero[0], one[0]);  // each device has its own bias
  const int ids[] = {0};
  sim.reset(ids);
  sim.step(1);
  const auto fresh = gyro(0), other = gyro(1);
  // The body is at rest: no row of the last episode arrives late.
  EXPECT_NEAR(fresh[2], 0, 4 * 0.3);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NE(fresh[k], zero[k]);  // another device
    EXPECT_EQ(other[k], one[k]);   // world 1 was not reset
  }
  sim.step(3);
  EXPECT_EQ(gyro(0), fresh);  // still the same device
}

// Each axis has the tolerance given by its data sheet.
TEST(Imu, EveryAxisHasASeparateTolerance) {
  ImuSensorCfg cfg = imu("");
  cfg.model.accelerometer.bias_tolerance = {0.3, 1.5, 6.0};
  auto scene = make_scene(cfg);
  constexpr int kWorlds = 2000;
  sim::Simulation sim(scene, {.num_worlds = kWorlds});
  sim.refresh(scene->sensor("imu"));
  double square[3] = {};
  const double rest[3] = {0, 9.81, 0};
  for (int w = 0; w < kWorlds; ++w)
    for (int k = 0; k < 3; ++k) {
      const double b = scene->sensor("imu").field("acc").data.row<float>(w)[k] - rest[k];
      square[k] += b * b / kWorlds;
    }
  for (int k = 0; k < 3; ++k) {
    const double expected = cfg.model.accelerometer.bias_tolerance[k] / 3;
    EXPECT_NEAR(std::sqrt(square[k]), expected, 5 * expected / std::sqrt(2.0 * kWorlds)) << k;
  }
}

// An axis sees of another one the sine of the angle between the axis and where it should be; the tolerance is three standard deviations.
TEST(Imu, CrossAxisSensitivityMixesAxes) {
  ImuSensorCfg cfg = imu("");
  cfg.model.accelerometer.cross_axis_tolerance = 0.06;
  auto scene = make_scene(cfg);
  constexpr int kWorlds = 2000;
  sim::Simulation sim(scene, {.num_worlds = kWorlds});
  sim.refresh(scene->sensor("imu"));
  double square[3] = {};
  for (int w = 0; w < kWorlds; ++w) {
    for (int k = 0; k < 3; ++k) {
      const double a = scene->sensor("imu").field("acc").data.row<float>(w)[k];
      square[k] += a * a / kWorlds;
    }
  }
  const double expected = 9.81 * 0.02, tolerance = 5 * expected / std::sqrt(2.0 * kWorlds);
  EXPECT_NEAR(std::sqrt(square[0]), expected, tolerance);
  EXPECT_NEAR(std::sqrt(square[1]), 9.81, 0.01);  // gravity is along y
  EXPECT_NEAR(std::sqrt(square[2]), expected, tolerance);
}

TEST(Imu, ErrorsNameSiteAndPreset) {
  const auto message = [](const ImuSensorCfg& cfg) -> std::string {
    return error_of([&] { make_scene(cfg); });
  };
  EXPECT_THAT(message(imu("mpu6500")), HasSubstr("did you mean 'mpu6050'?"));
  ImuSensorCfg cfg = imu("ideal");
  cfg.site.name = "imo";
  EXPECT_THAT(message(cfg), HasSubstr("no site named 'robot/imo'; did you mean 'robot/imu'?"));
}

}  // namespace
}  // namespace mjsense::sensors
