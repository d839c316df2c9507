// SPDX-License-Identifier: Apache-2.0
// Cost of contact sensing in one world: ours (one pass for all sensors), and MuJoCo's own contact
// sensors for the same content (one per primary, all fields packed). Report CPU time per step of a
// world.

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/testing/test_model.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {
namespace {

struct Model {
  explicit Model(const std::string& xml) : model(compile_mjcf(xml)), data(make_data(model.get())) {
    for (int i = 0; i < 200; ++i) mj_step(m, d);
    mj_forward(m, d);
  }
  ModelPtr model;
  DataPtr data;
  mjModel* m = model.get();
  mjData* d = data.get();
};

// `legs` two-link legs around a torso, with the feet on a plane. Feet are geoms foot_0, foot_1 ...
std::string walker(int legs, const std::string& sensors) {
  std::string xml =
      R"(<mujoco><option timestep=".002" integrator="implicitfast"/><size memory="50M"/><worldbody><geom name="floor" type="plane" size="0 0 1"/>
      <body pos="0 0 .29"><freejoint/><geom type="box" size=".2 .1 .05" mass="6" contype="0" conaffinity="0"/>)";
  for (int i = 0; i < legs; ++i) {
    const double x = .4 * i / legs - .2, y = i % 2 ? .15 : -.15;
    xml += fmt::format(
        R"(<body pos="{:.3f} {} 0"><joint axis="0 1 0" stiffness="80" damping="2"/><geom type="capsule" fromto="0 0 0 0 0 -.14" size=".01" mass=".2" contype="0" conaffinity="0"/>
        <body pos="0 0 -.14"><joint axis="0 1 0" stiffness="80" damping="2"/><geom type="capsule" fromto="0 0 0 0 0 -.13" size=".01" mass=".1" contype="0" conaffinity="0"/>
        <geom name="foot_{}" type="sphere" size=".02" pos="0 0 -.13" mass=".05" contype="2" conaffinity="1"/></body></body>)",
        x, y, i);
  }
  return xml + "</body></worldbody><sensor>" + sensors + "</sensor></mujoco>";
}

ContactSensorCfg feet(int primaries, bool memory) {
  ContactSensorCfg cfg;
  cfg.name = "feet";
  for (int i = 0; i < primaries; ++i) cfg.primary.pattern.push_back(fmt::format("foot_{}", i));
  cfg.secondary = ContactMatch{"body", {"world"}, "", {}};
  cfg.fields = {"found", "force", "torque", "dist", "pos", "normal", "tangent"};
  if (memory) {
    cfg.track_air_time = cfg.track_events = cfg.latch = true;
    cfg.history_length = 4;
  }
  return cfg;
}

std::string native(int primaries) {
  std::string xml;
  for (int i = 0; i < primaries; ++i) {
    xml += fmt::format(
        R"(<contact geom1="foot_{}" body2="world" reduce="maxforce" data="found force torque dist pos normal tangent"/>)",
        i);
  }
  return xml;
}

std::unique_ptr<Sensor> make(const ContactSensorCfg& cfg, const mjModel* m) {
  std::unique_ptr<Sensor> s = cfg.build();
  SensorInit init;
  init.model = m;
  init.decimation = 4;
  s->initialize(init);
  return s;
}

void physics(benchmark::State& state) {
  Model model(walker(4, ""));
  for (auto _ : state) mj_step(model.m, model.d);
}
BENCHMARK(physics)->Name("contact/physics_4_legs");

// Number of primaries, and number of contacts: few, and all.
void few_and_all(benchmark::internal::Benchmark* b) {
  b->Args({4, 4})->Args({32, 4})->Args({32, 32})->Args({256, 4})->Args({256, 256});
}

// Every iteration has a new moment, so that no pass is skipped.
void ours(benchmark::State& state, bool memory) {
  const int primaries = static_cast<int>(state.range(0)),
            touching = static_cast<int>(state.range(1));
  Model model(walker(std::max(primaries, 4), ""));
  model.d->ncon = std::min(model.d->ncon, touching);
  auto sensor = make(feet(primaries, memory), model.m);
  World world{0, model.m, model.d};
  for (auto _ : state) {
    ++world.moment;
    if (memory) {
      sensor->substep(world);
    } else {
      sensor->compute(world);
    }
  }
  state.counters["contacts"] = model.d->ncon;
}
BENCHMARK_CAPTURE(ours, fields, false)->Name("contact/ours_7_fields")->Apply(few_and_all);
BENCHMARK_CAPTURE(ours, memory, true)->Name("contact/ours_with_memory")->Apply(few_and_all);

void mujocos(benchmark::State& state) {
  const int primaries = static_cast<int>(state.range(0)),
            touching = static_cast<int>(state.range(1));
  Model model(walker(std::max(primaries, 4), native(primaries)));
  model.d->ncon = std::min(model.d->ncon, touching);
  for (auto _ : state) mj_sensorAcc(model.m, model.d);
  state.counters["contacts"] = model.d->ncon;
}
BENCHMARK(mujocos)->Name("contact/mujoco_7_fields")->Apply(few_and_all);

}  // namespace
}  // namespace mjsense::sensors
