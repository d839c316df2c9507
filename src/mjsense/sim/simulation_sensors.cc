// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "mjsense/core/error.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/sim/sensor_errors.h"
#include "mjsense/sim/simulation.h"
#include "mjsense/sim/simulation_slots.h"

namespace mjsense::sim {

// Initializes in the order of the registry, except that a sensor follows those that it reads.
void Simulation::initialize_scene() {
  std::vector<Sensor*> done, open;
  const auto contains = [](const std::vector<Sensor*>& list, const Sensor* s) {
    return std::find(list.begin(), list.end(), s) != list.end();
  };
  const std::function<void(Sensor&)> visit = [&](Sensor& sensor) {
    if (contains(done, &sensor)) return;
    if (contains(open, &sensor)) {
      throw ValueError(fmt::format("sensor '{}': reads itself", sensor.name()));
    }
    open.push_back(&sensor);
    for (const std::string& key : sensor.initialization_dependencies()) {
      guarded(sensor, [&] { visit(scene_->sensor(key)); });
    }
    open.pop_back();
    initialize(sensor);
    done.push_back(&sensor);
  };
  for (auto& sensor : scene_->sensors()) visit(*sensor);
}

rays::RayScene& Simulation::rays() {
  if (!rays_) rays_ = std::make_unique<rays::RayScene>(scene_->model(), cfg_.num_worlds);
  return *rays_;
}

void Simulation::initialize(Sensor& sensor) {
  const SensorInit init{scene_->model(), scene_.get(),  cfg_.num_worlds,
                        cfg_.decimation, pool_->size(), &shared_};
  guarded(sensor, [&] { sensor.initialize(init); });
  auto slot = std::make_unique<Slot>();
  slot->sensor = &sensor;
  slot->listener = dynamic_cast<ControlStepListener*>(&sensor);
  slot->computed.assign(cfg_.num_worlds, 0);
  slot->compute_s.assign(cfg_.num_worlds, 0.0);
  slot->casts = sensor.stage() == Stage::kCast || sensor.stage() == Stage::kBatch;
  if (sensor.stage() == Stage::kPostCast) slot->phase = 1;
  for (const Sensor* input : sensor.inputs()) {
    Slot& in = slot_of(*input);
    slot->inputs.push_back(&in);
    slot->phase = std::max(slot->phase, in.phase + (in.casts ? 1 : 0));
  }
  if (sensor.stage() == Stage::kCast) rays();
  slot->needs = sensor.needs();
  if (sensor.wants_substep()) {
    any_substep_ = true;
    substep_stage_ = std::max(substep_stage_, slot->needs);
  }
  slots_.push_back(std::move(slot));
}

void Simulation::add(std::shared_ptr<Sensor> sensor) {
  initialize(*sensor);
  added_.push_back(std::move(sensor));
}

Simulation::Slot& Simulation::slot_of(const Sensor& sensor) const {
  for (auto& slot : slots_) {
    if (slot->sensor == &sensor) return *slot;
  }
  throw ValueError(fmt::format("sensor '{}' does not belong to this simulation: call add() first",
                               sensor.name()));
}

}  // namespace mjsense::sim
