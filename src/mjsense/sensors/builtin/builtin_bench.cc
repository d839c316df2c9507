// SPDX-License-Identifier: Apache-2.0
// Cost of a built-in sensor in addition to MuJoCo's own computation: copying its row, compared with
// a physics step of the same model.

#include <benchmark/benchmark.h>

#include "mjsense/scene/scene.h"
#include "mjsense/sensors/builtin/builtin_sensor.h"

namespace mjsense::sensors {
namespace {

constexpr const char* kLegged = R"(<mujoco><worldbody><geom type="plane" size="9 9 1"/>
  <body name="trunk" pos="0 0 .35"><freejoint/><geom type="box" size=".2 .1 .06" mass="6"/><site name="imu"/>
    <replicate count="4" euler="0 0 90"><body pos=".18 .1 0"><joint axis="1 0 0"/><geom type="capsule" fromto="0 0 0 0 .05 0" size=".03"/>
      <body pos="0 .05 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/>
        <body pos="0 0 -.2"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".015"/></body></body></body></replicate>
  </body></worldbody></mujoco>)";

struct Legged {
  explicit Legged(int sensors) : scene(cfg(sensors)), data(mj_makeData(scene.model())) {
    for (const auto& sensor : scene.sensors()) sensor->initialize({scene.model(), &scene, 1});
    for (int i = 0; i < 200; ++i) mj_step(scene.model(), data);
  }
  ~Legged() { mj_deleteData(data); }
  static scene::SceneCfg cfg(int sensors) {
    const char* types[] = {"accelerometer", "gyro", "velocimeter", "framequat", "framezaxis"};
    scene::SceneCfg cfg;
    cfg.entities = {{"robot", {.model = {.xml = kLegged}}}};
    for (int i = 0; i < sensors; ++i) {
      auto sensor = std::make_shared<BuiltinSensorCfg>();
      sensor->name = std::to_string(i);
      sensor->sensor_type = types[i % 5];
      sensor->obj = {"site", "imu", "robot"};
      cfg.sensors.push_back(sensor);
    }
    return cfg;
  }
  scene::Scene scene;
  mjData* data;
};

void physics_step(benchmark::State& state) {
  Legged legged(static_cast<int>(state.range(0)));
  for (auto _ : state) mj_step(legged.scene.model(), legged.data);
}
BENCHMARK(physics_step)->Name("builtin/physics_step_with_sensors")->Arg(0)->Arg(10);

void rows(benchmark::State& state) {
  Legged legged(static_cast<int>(state.range(0)));
  const World world{.id = 0, .model = legged.scene.model(), .data = legged.data};
  for (auto _ : state) {
    for (const auto& sensor : legged.scene.sensors()) sensor->compute(world);
  }
}
BENCHMARK(rows)->Name("builtin/rows")->Arg(10);

}  // namespace
}  // namespace mjsense::sensors
