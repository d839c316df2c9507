#include "mjsense/sensors/imu/imu_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {
namespace {

using ::testing::HasSubstr;

// A body at rest, its site rolled by 90 degrees: up is the site's +y.
constexpr char kRest[] = R"(
<mujoco><worldbody><body name="b" pos="0 0 1"><geom size=".1"/><site name="imu" euler="90 0 0"/></body>
</worldbody></mujoco>)";

std::shared_ptr<Scene> make_scene(const ImuSensorCfg& cfg) {
  SceneCfg scene;
  EntityCfg entity;
  entity.model.xml = kRest;
  scene.entities.emplace_back("robot", entity);
  scene.sensors.push_back(std::make_shared<ImuSensorCfg>(cfg));
  return std::make_shared<Scene>(std::move(scene));
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
  Simulation sim(scene, {});
  sim.step();
  sim.refresh(scene->sensor("imu"));
  const auto acc = scene->sensor("imu").field("acc").data.row<float>(0);
  EXPECT_NEAR(acc[0], 0, 1e-5);
  EXPECT_NEAR(acc[1], 9.81, 1e-5);
  EXPECT_NEAR(acc[2], 0, 1e-5);
  EXPECT_TRUE(scene->find_sensor("imu_acc"));  // the clean value
}

TEST(Imu, DataSheetNumbersComeOut) {
  auto scene = make_scene(imu("mpu6050"));
  SimulationCfg cfg;
  cfg.num_worlds = 256;
  cfg.decimation = 5;  // 10 ms
  Simulation sim(scene, cfg);
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
      EXPECT_NEAR(x * 16.4 / deg, std::round(x * 16.4 / deg), 0.01);  // whole counts
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
  // 0.005 deg/s/sqrt(Hz) at 100 Hz and the rounding to counts: step^2 / 12.
  const double expected = std::hypot(0.005 / std::sqrt(0.01), 1 / 16.4 / std::sqrt(12));
  EXPECT_NEAR(std::sqrt(noise2 / n) / deg, expected, 0.05 * expected);
}

TEST(Imu, ErrorsNameSiteAndPreset) {
  const auto message = [](const ImuSensorCfg& cfg) -> std::string {
    try {
      make_scene(cfg);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(message(imu("mpu6500")), HasSubstr("did you mean 'mpu6050'?"));
  ImuSensorCfg cfg = imu("ideal");
  cfg.site.name = "imo";
  EXPECT_THAT(message(cfg), HasSubstr("no site named 'robot/imo'; did you mean 'robot/imu'?"));
}

}  // namespace
}  // namespace mjsense
