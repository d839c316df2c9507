// SPDX-License-Identifier: Apache-2.0
// Properties of every kind of sensor: row w of B worlds is the row of world w alone, bit for bit,
// for any number of threads; a partial reset affects its worlds only; a step does not allocate.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/testing/allocations.h"
#include "mjsense/sensors/testing/every_sensor.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

constexpr int kWorlds = 16, kSteps = 12;

// Row `row` simulates world `w`, with its random numbers (those of a reset too) and its start
// state.
void begin(sim::Simulation& sim, int row, int w) {
  sim.worlds().rekey(row, static_cast<std::uint32_t>(w));
  const int ids[] = {row};
  sim.reset(ids);
  const ArrayView qvel = sim.worlds().state_component("qvel");
  auto* v = reinterpret_cast<double*>(qvel.data + row * qvel.strides[0]);
  for (int i = 0; i < sim.model()->nv; ++i) v[i] = std::sin(1.7 * i + w);
}

void control(sim::Simulation& sim, int row, int w, int step) {
  const ArrayView ctrl = sim.worlds().state_component("ctrl");
  auto* u = reinterpret_cast<double*>(ctrl.data + row * ctrl.strides[0]);
  for (int i = 0; i < sim.model()->nu; ++i) u[i] = std::sin(0.4 * step + w + i);
}

std::vector<Sensor*> sensors(sim::Simulation& sim) {
  std::vector<Sensor*> list;
  for (const auto& s : sim.scene().sensors()) list.push_back(s.get());
  return list;
}

// Bytes of every field of every sensor in every step; rows[i] is that of world `first` + i.
std::vector<std::string> play(int first, int worlds, int threads) {
  sim::Simulation sim(std::make_shared<scene::Scene>(every_sensor_scene()),
                      {.num_worlds = worlds, .decimation = 3, .threads = threads});
  std::vector<std::string> rows(worlds);
  for (int row = 0; row < worlds; ++row) begin(sim, row, first + row);
  sim.forward();
  const std::vector<Sensor*> all = sensors(sim);
  for (int k = 0; k <= kSteps; ++k) {
    sim.refresh(all);
    for (const Sensor* s : all) {
      for (const Field& f : s->fields()) {
        for (int row = 0; row < worlds; ++row) {
          rows[row].append(reinterpret_cast<const char*>(f.data.row_data(row)), f.data.row_bytes());
        }
      }
    }
    for (int row = 0; row < worlds; ++row) control(sim, row, first + row, k);
    if (k < kSteps) sim.step();
  }
  return rows;
}

TEST(Lockstep, RowsDoNotDependOnBatchSizeOrThreads) {
  const std::vector<std::string> reference = play(0, kWorlds, 1);
  EXPECT_NE(reference[0], reference[1]);
  for (int threads : {2, 5})
    EXPECT_EQ(play(0, kWorlds, threads), reference) << threads << " threads";
  for (int w : {0, 7, kWorlds - 1})
    EXPECT_EQ(play(w, 1, 2)[0], reference[w]) << "world " << w << " alone";
}

TEST(Lockstep, PartialResetAffectsItsWorldsOnly) {
  sim::Simulation sim(std::make_shared<scene::Scene>(every_sensor_scene()),
                      {.num_worlds = 3, .decimation = 3, .threads = 2});
  const std::vector<Sensor*> all = sensors(sim);
  for (int row = 0; row < 3; ++row) begin(sim, row, row);
  sim.step(5);
  sim.refresh(all);
  auto row = [&](int w) {
    std::string bytes;
    for (const Sensor* s : all) {
      for (const Field& f : s->fields())
        bytes.append(reinterpret_cast<const char*>(f.data.row_data(w)), f.data.row_bytes());
    }
    return bytes;
  };
  const std::string zero = row(0), one = row(1), two = row(2);
  const int ids[] = {1};
  sim.reset(ids);
  sim.refresh(all);
  EXPECT_EQ(row(0), zero);
  EXPECT_EQ(row(2), two);
  EXPECT_NE(row(1), one);
}

TEST(Lockstep, StepDoesNotAllocate) {
  sim::Simulation sim(std::make_shared<scene::Scene>(every_sensor_scene()),
                      {.num_worlds = 4, .decimation = 3, .threads = 2});
  const std::vector<Sensor*> all = sensors(sim);
  auto step = [&] {
    sim.step();
    sim.refresh(all);
  };
  for (int k = 0; k < 10; ++k) step();
  for (Sensor* s : all) {
    const AllocationCount count;
    for (int k = 0; k < 5; ++k) {
      sim.step();
      sim.refresh(*s);
    }
    EXPECT_EQ(count.since(), 0) << s->name();
  }
}

TEST(EverySensor, HasAnExampleAndTheDeclaredFields) {
  sim::Simulation sim(std::make_shared<scene::Scene>(every_sensor_scene()), {.num_worlds = 2});
  for (const SensorKind& kind : sensor_kinds()) {
    int examples = 0;
    for (const Sensor* s : sensors(sim)) {
      if (s->kind() != kind.cfg->kind) continue;
      ++examples;
      for (const Field& field : s->fields()) {
        if (!kind.data) continue;
        const DataField& declared = kind.data->field(field.name);
        EXPECT_EQ(field.spec.dtype, declared.dtype) << field.spec.name;
        EXPECT_EQ(field.spec.unit, declared.unit) << field.spec.name;
        EXPECT_EQ(field.spec.shape.rank(), std::ranges::count(declared.shape, ','))
            << field.spec.name;
      }
    }
    EXPECT_GT(examples, 0) << kind.cfg->kind;
  }
}

}  // namespace
}  // namespace mjsense::sensors
