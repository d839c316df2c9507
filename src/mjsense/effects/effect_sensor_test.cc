// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/effect_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/testing/bench.h"
#include "mjsense/effects/timing.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::effects {
namespace {

using ::testing::HasSubstr;

constexpr char kPendulum[] = R"(
<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><site name="imu" pos=".2 0 0"/></body>
</worldbody>
<sensor><gyro name="gyro" site="imu"/><accelerometer name="acc" site="imu"/></sensor></mujoco>)";

std::shared_ptr<scene::Scene> make_scene(EffectSensorCfg cfg) {
  scene::SceneCfg scene;
  scene::EntityCfg arm;
  arm.model.xml = kPendulum;
  scene.entities.emplace_back("robot", arm);
  scene.sensors.push_back(std::make_shared<EffectSensorCfg>(std::move(cfg)));
  return std::make_shared<scene::Scene>(std::move(scene));
}

// Reads a sensor that the scene finds in the XML. Those follow the configured sensors, so this
// sensor must be computed after a later one.
EffectSensorCfg noisy() {
  EffectSensorCfg cfg;
  cfg.name = "noisy";
  cfg.sensor = "robot/gyro";
  BiasDrift drift;
  drift.std = {0.1};
  drift.time_constant_s = 1.0;
  Delay delay(0.02);
  delay.jitter_s = 0.01;
  cfg.effects = {std::make_shared<Noise>(Draw::gaussian({0.2})), std::make_shared<BiasDrift>(drift),
                 std::make_shared<EpisodeBias>(Draw::uniform({-1}, {1})),
                 std::make_shared<Delay>(delay), std::make_shared<Dropout>(0.2)};
  cfg.history_length = 2;
  return cfg;
}

TEST(EffectSensor, CleanSensorIsUnchangedAndDelayIsInSeconds) {
  EffectSensorCfg cfg;
  cfg.name = "late";
  cfg.sensor = "robot/gyro";
  cfg.effects = {std::make_shared<Delay>(0.016)};
  auto scene = make_scene(cfg);
  sim::SimulationCfg sim_cfg;
  sim_cfg.decimation = 4;  // 8 ms per step
  sim::Simulation sim(scene, sim_cfg);
  std::vector<float> clean;
  for (int k = 0; k < 20; ++k) {
    sim.step();
    if (k == 7) sim.forward();  // measures the same tick again
    Sensor* both[] = {&scene->sensor("late"), &scene->sensor("robot/gyro")};
    sim.refresh(both);
    clean.push_back(both[1]->field().data.row<float>(0)[1]);
    const float late = both[0]->field().data.row<float>(0)[1];
    EXPECT_EQ(late, k >= 2 ? clean[k - 2] : 0.0f) << k;
  }
  EXPECT_NE(clean[19], clean[17]);
  EXPECT_EQ(scene->sensor("late").field().spec.unit, scene->sensor("robot/gyro").field().spec.unit);
}

// A history has the value of each step, also of steps at which the sensor is not read.
TEST(EffectSensor, AHistoryHasEveryStep) {
  EffectSensorCfg cfg;
  cfg.name = "past";
  cfg.sensor = "robot/gyro";
  cfg.history_length = 3;
  auto scene = make_scene(cfg);
  sim::Simulation sim(scene, {});
  std::vector<float> clean;
  for (int k = 0; k < 6; ++k) {
    sim.step();
    sim.refresh(scene->sensor("robot/gyro"));
    clean.push_back(scene->sensor("robot/gyro").field().data.row<float>(0)[1]);
  }
  sim.refresh(scene->sensor("past"));
  const auto past = scene->sensor("past").field().data.row<float>(0);
  ASSERT_EQ(past.size(), 9u);
  for (int k = 0; k < 3; ++k) EXPECT_EQ(past[3 * k + 1], clean[3 + k]) << k;
  EXPECT_NE(clean[3], clean[4]);
}

// Two sensors with the same noise have different numbers.
TEST(EffectSensor, NoiseDependsOnTheNameOfTheSensor) {
  scene::SceneCfg scene_cfg;
  scene::EntityCfg arm;
  arm.model.xml = kPendulum;
  scene_cfg.entities.emplace_back("robot", arm);
  for (const char* name : {"one", "other"}) {
    auto cfg = std::make_shared<EffectSensorCfg>();
    cfg->name = name;
    cfg->sensor = "robot/gyro";
    cfg->effects = {std::make_shared<Noise>(Draw::gaussian({1}))};
    scene_cfg.sensors.push_back(cfg);
  }
  auto scene = std::make_shared<scene::Scene>(scene_cfg);
  sim::Simulation sim(scene, {});
  Sensor* both[] = {&scene->sensor("one"), &scene->sensor("other")};
  sim.refresh(both);
  EXPECT_NE(both[0]->field().data.row<float>(0)[0], both[1]->field().data.row<float>(0)[0]);
}

TEST(EffectSensor, BitEqualAtAnyBatchAndThreadCount) {
  constexpr int kWorlds = 16, kAlone = 5;
  std::vector<std::shared_ptr<scene::Scene>> scenes;
  std::vector<std::unique_ptr<sim::Simulation>> sims;
  for (int threads : {1, 2, 5}) {
    scenes.push_back(make_scene(noisy()));
    sim::SimulationCfg cfg;
    cfg.num_worlds = kWorlds;
    cfg.decimation = 3;
    cfg.threads = threads;
    cfg.seed = 9;
    sims.push_back(std::make_unique<sim::Simulation>(scenes.back(), cfg));
  }
  sim::SimulationCfg one;
  one.decimation = 3;
  one.seed = 9;
  auto alone_scene = make_scene(noisy());
  sim::Simulation alone(alone_scene, one);
  alone.worlds().rekey(0, kAlone);
  alone.reset();
  for (int k = 0; k < 60; ++k) {
    for (auto& sim : sims) {
      if (k % 20 == 10) sim->reset(std::vector<int>{kAlone});
      sim->step();
      sim->refresh(sim->scene().sensor("noisy"));
    }
    if (k % 20 == 10) alone.reset();
    alone.step();
    alone.refresh(alone_scene->sensor("noisy"));
    const Array& a = scenes[0]->sensor("noisy").field().data;
    for (std::size_t i = 1; i < sims.size(); ++i) {
      const Array& b = scenes[i]->sensor("noisy").field().data;
      ASSERT_EQ(std::memcmp(a.data(), b.data(), a.bytes()), 0) << k;
    }
    const Array& s = alone_scene->sensor("noisy").field().data;
    ASSERT_EQ(std::memcmp(a.row_data(kAlone), s.data(), s.bytes()), 0) << k;
  }
}

TEST(EffectSensor, ErrorsNameSensorsAndFields) {
  const auto message = [](EffectSensorCfg cfg) -> std::string {
    return error_of([&] { sim::Simulation sim(make_scene(std::move(cfg)), {}); });
  };
  EffectSensorCfg cfg;
  cfg.name = "x";
  cfg.sensor = "robot/gyo";
  EXPECT_THAT(message(cfg), HasSubstr("robot/gyro"));
  cfg.sensor = "x";
  EXPECT_THAT(message(cfg), HasSubstr("reads itself"));
  cfg.sensor = "robot/gyro";
  cfg.fields = {"force"};
  EXPECT_THAT(message(cfg), HasSubstr("no field of 'robot/gyro' named 'force'"));
}

TEST(EffectSensor, InvalidEffectsAreRefusedAtBuild) {
  const auto message = [](Effects effects) -> std::string {
    EffectSensorCfg cfg;
    cfg.name = "noisy";
    cfg.sensor = "clean";
    cfg.effects = std::move(effects);
    return error_of<ValueError>([&] { cfg.build(); });
  };
  const double nan = std::nan("");
  EXPECT_EQ(message(one(Dropout(0.5))), "");
  EXPECT_EQ(message(one(Dropout(2))),
            "sensor 'noisy': effects[0]: probability is 2: must be between 0 and 1");
  EXPECT_THAT(message({nullptr}), HasSubstr("effects[0] is null"));
  StepDelay lags(2, 1);
  BiasDrift drift;
  drift.std = {-1};
  Misalignment tilt;
  tilt.angle = {nan, 0, 0};
  for (const Effects& wrong :
       {one(Noise(Draw::gaussian({nan}))), one(Noise(Draw::uniform({1}, {0}))),
        one(Noise(Draw::constant({}))), one(EpisodeBias(Draw::gaussian({-1}))), one(drift),
        one(Scale({nan})), one(tilt), one(Clip({2}, {1})), one(Quantize({-1})), one(Delay(nan)),
        one(lags), one(Rate(nan)), one(Dropout(nan))}) {
    EXPECT_THAT(message(wrong), HasSubstr("sensor 'noisy': effects[0]"));
  }
}

}  // namespace
}  // namespace mjsense::effects
