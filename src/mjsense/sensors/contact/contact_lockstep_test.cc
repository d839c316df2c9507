// SPDX-License-Identifier: Apache-2.0
// Row w of B worlds is the row of world w alone, bit for bit, for any number of threads; a step
// does not allocate.

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "mjsense/core/testing/allocations.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/contact/contact_sensor.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

constexpr char kHeap[] = R"(
<mujoco><worldbody>
  <body name="a" pos="0 0 .2"><freejoint/><geom name="a" type="box" size=".1 .1 .05"/></body>
  <body name="b" pos=".05 0 .4">
    <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
    <joint type="slide" axis="0 0 1"/><joint type="ball"/>
    <geom name="b" type="box" size=".1 .1 .05"/></body>
  <body name="c" pos="0 .05 .6">
    <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
    <joint type="slide" axis="0 0 1"/><joint type="ball"/>
    <geom name="c" type="capsule" size=".05 .1"/></body>
</worldbody></mujoco>)";

std::shared_ptr<scene::Scene> make_scene() {
  scene::SceneCfg cfg;
  scene::EntityCfg entity;
  entity.model.xml = kHeap;
  cfg.entities.emplace_back("heap", entity);
  cfg.terrain = scene::TerrainCfg{};
  for (std::size_t i = 0; i < kEnumNames<ContactReduce>.size(); ++i) {
    const auto reduce = static_cast<ContactReduce>(i);
    for (bool memory : {false, true}) {
      ContactSensorCfg c;
      c.name = std::string(enum_name(reduce)) + (memory ? "_memory" : "");
      c.primary = {"body", {".*"}, "heap", {}};
      c.fields = {"found", "force", "torque", "dist", "pos", "normal", "tangent"};
      c.reduce = reduce;
      c.num_slots = 3;
      c.friction_split = c.other_ids = true;
      if (memory) {
        c.track_air_time = c.track_events = c.latch = true;
        c.history_length = 5;
        c.secondary = ContactMatch{"geom", {".*"}, "heap", {}};
        c.secondary_policy = "each";
      }
      cfg.sensors.push_back(std::make_shared<ContactSensorCfg>(c));
    }
  }
  return std::make_shared<scene::Scene>(std::move(cfg));
}

// Gives a world random velocities, which depend on w only.
void throw_world(sim::Simulation& sim, int row, int w) {
  std::mt19937 random(100 + w);
  std::uniform_real_distribution<double> u(-1, 1);
  const ArrayView qvel = sim.worlds().state_component("qvel");
  auto* v = reinterpret_cast<double*>(qvel.data + row * qvel.strides[0]);
  for (int i = 0; i < sim.model()->nv; ++i) v[i] = u(random);
}

std::vector<Sensor*> contact_sensors(sim::Simulation& sim) {
  std::vector<Sensor*> list;
  for (const auto& s : sim.scene().sensors()) {
    if (s->kind() == "contact") list.push_back(s.get());
  }
  return list;
}

TEST(ContactLockstep, AnyBatchAndThreadCountIsBitEqual) {
  constexpr int kWorlds = 16, kSteps = 40;
  struct Run {
    std::shared_ptr<scene::Scene> scene;
    std::unique_ptr<sim::Simulation> sim;
  };
  std::vector<Run> runs;
  for (int threads : {1, 2, 5}) {
    sim::SimulationCfg cfg;
    cfg.num_worlds = kWorlds;
    cfg.decimation = 4;
    cfg.threads = threads;
    auto scene = make_scene();
    runs.push_back({scene, std::make_unique<sim::Simulation>(scene, cfg)});
    for (int w = 0; w < kWorlds; ++w) throw_world(*runs.back().sim, w, w);
  }
  sim::SimulationCfg one;
  one.decimation = 4;
  one.threads = 1;
  constexpr int kAlone = 11;
  auto scene = make_scene();
  sim::Simulation alone(scene, one);
  throw_world(alone, 0, kAlone);
  for (int step = 0; step < kSteps; ++step) {
    for (Run& run : runs) {
      run.sim->step();
      run.sim->refresh(contact_sensors(*run.sim));
    }
    alone.step();
    alone.refresh(contact_sensors(alone));
    for (std::size_t i = 0; i < contact_sensors(alone).size(); ++i) {
      for (const Field& f : contact_sensors(*runs[0].sim)[i]->fields()) {
        for (std::size_t r = 1; r < runs.size(); ++r) {
          const Array& other = contact_sensors(*runs[r].sim)[i]->field(f.name).data;
          ASSERT_EQ(std::memcmp(f.data.data(), other.data(), f.data.bytes()), 0) << f.spec.name;
        }
        const Array& single = contact_sensors(alone)[i]->field(f.name).data;
        ASSERT_EQ(std::memcmp(f.data.row_data(kAlone), single.data(), single.bytes()), 0)
            << f.spec.name << " step " << step;
      }
    }
  }
}

TEST(ContactLockstep, StepDoesNotAllocate) {
  sim::SimulationCfg cfg;
  cfg.num_worlds = 4;
  cfg.decimation = 3;
  cfg.threads = 2;
  sim::Simulation sim(make_scene(), cfg);
  const std::vector<Sensor*> sensors = contact_sensors(sim);
  for (int i = 0; i < 3; ++i) {
    sim.step();
    sim.refresh(sensors);
  }
  const AllocationCount count;
  for (int i = 0; i < 200; ++i) {
    sim.step();
    sim.refresh(sensors);
  }
  EXPECT_EQ(count.since(), 0);
}

}  // namespace
}  // namespace mjsense::sensors
