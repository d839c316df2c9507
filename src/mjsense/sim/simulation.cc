// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sim/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/sim/sensor_errors.h"
#include "mjsense/sim/simulation_hooks.h"
#include "mjsense/sim/simulation_slots.h"

namespace mjsense::sim {
namespace {

// Runs `first`, then `next` until it returns false, even if they throw RowError, so that all
// listeners are notified although some rows could not be computed. Then the first exception is
// rethrown.
template <class First, class Next>
void after_all(First&& first, Next&& next) {
  std::exception_ptr fault;
  const auto keep = [&](auto&& body) {
    try {
      return body();
    } catch (const RowError&) {
      if (!fault) fault = std::current_exception();
      return true;
    }
  };
  keep([&] {
    first();
    return true;
  });
  while (keep(next)) {
  }
  if (fault) std::rethrow_exception(fault);
}

}  // namespace

Simulation::Simulation(std::shared_ptr<scene::Scene> scene, const SimulationCfg& cfg)
    : cfg_(cfg), scene_(std::move(scene)) {
  if (cfg.decimation < 1)
    throw ValueError(fmt::format("decimation is {}: must be at least 1", cfg.decimation));
  claim_ = scene_->claim();
  worlds_ = std::make_unique<worlds::Worlds>(scene_->model(), cfg.num_worlds, cfg.threads);
  worlds_->seed(cfg.seed);
  // Not worlds_->threads(): MuJoCo's pool is limited to the number of worlds, but a single image
  // has many tiles.
  pool_ = std::make_unique<ThreadPool>(cfg.threads);
  version_.assign(cfg.num_worlds, 1);
  rays_version_.assign(cfg.num_worlds, 0);
  rays_s_.assign(cfg.num_worlds, 0.0);
  initialize_scene();
  reset();
}

Simulation::~Simulation() = default;

// Collects the slots for which `wanted` holds, and their inputs, in order: an input was initialized
// before the sensor that reads it.
template <class Wanted>
void Simulation::collect(std::vector<Slot*>& slots, Wanted&& wanted) {
  for (auto slot = slots_.rbegin(); slot != slots_.rend(); ++slot) {
    (*slot)->wanted |= wanted(**slot);
    if ((*slot)->wanted) {
      for (Slot* input : (*slot)->inputs) input->wanted = true;
    }
  }
  for (auto& slot : slots_) {
    if (slot->wanted) slots.push_back(slot.get());
    slot->wanted = false;
  }
}

void Simulation::mark_stale(std::span<const int> ids) {
  for (int w : ids) ++version_[w];
}

void Simulation::compute(std::span<Slot* const> slots, std::span<const int> ids, Change change,
                         int argument) {
  int last_phase = 0;
  for (const Slot* slot : slots) last_phase = std::max(last_phase, slot->phase);
  for (int phase = 0; phase <= last_phase; ++phase) {
    Hooks hooks(*this, slots, phase);
    if (phase > 0) {
      worlds_->visit(ids, hooks);
    } else {
      switch (change) {
        case Change::kStep:
        case Change::kFollow:
          after_all(
              [&] {
                change == Change::kStep ? worlds_->step(argument, hooks, ids)
                                        : worlds_->follow(argument, hooks, ids);
              },
              // By index, because a listener may add sensors.
              [&, i = std::size_t{0}]() mutable {
                if (i == slots_.size()) return false;
                const Slot& slot = *slots_[i++];
                if (slot.listener) guarded(*slot.sensor, [&] { slot.listener->control_step(ids); });
                return true;
              });
          break;
        case Change::kForward:
          worlds_->forward(ids, hooks);
          break;
        case Change::kReset:
          worlds_->reset(ids, argument, hooks);
          break;
        case Change::kNone:
          worlds_->visit(ids, hooks);
          break;
      }
    }
    cast(slots, ids, phase);
  }
}

void Simulation::cast(std::span<Slot* const> slots, std::span<const int> ids, int phase) {
  for (const Stage stage : {Stage::kCast, Stage::kBatch}) {
    for (Slot* slot : slots) {
      if (slot->sensor->stage() != stage || slot->phase != phase) continue;
      Borrowed due(*this);
      for (int w : ids) {
        if (slot->computed[w] != version_[w]) due->ids.push_back(w);
      }
      if (due->ids.empty()) continue;
      const Timer timer(measure_cost_);
      try {
        guarded(*slot->sensor, [&] {
          slot->sensor->cast({rays_.get(), due->ids, *pool_, worlds_.get()});
        });
      } catch (const RowError& e) {
        for (int w : due->ids) {
          if (std::ranges::find(e.faults, w, &RowError::Fault::world) == e.faults.end())
            slot->computed[w] = version_[w];
        }
        throw;
      }
      slot->cast_s += timer.seconds();
      for (int w : due->ids) slot->computed[w] = version_[w];
    }
  }
}

void Simulation::step(int control_steps, worlds::WorldIds ids) {
  if (control_steps < 1)
    throw ValueError(fmt::format("step({}): must be at least 1", control_steps));
  for (int k = 0; k < control_steps; ++k)
    advance(ids, Change::kStep, cfg_.decimation, k + 1 == control_steps);
}

void Simulation::follow(int substeps, worlds::WorldIds ids) {
  advance(ids, Change::kFollow, substeps, true);
}

// If `last`, also computes the sensors that were read since the last call.
void Simulation::advance(worlds::WorldIds ids, Change change, int substeps, bool last) {
  Borrowed due(*this);
  collect(due->slots, [last](Slot& s) {
    const bool wanted = s.sensor->needs_every_step() || (last && s.read);
    if (last) s.read = false;
    return wanted;
  });
  worlds_->checked_ids(ids, due->ids);
  mark_stale(due->ids);
  compute(due->slots, due->ids, change, substeps);
}

void Simulation::set_control(int every, Control control) {
  if (every < 1)
    throw ValueError(fmt::format("set_control: every is {}: must be at least 1", every));
  control_ = std::move(control);
  control_every_ = control_ ? every : 0;
}

void Simulation::reset(worlds::WorldIds ids, int key) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Borrowed due(*this);
  collect(due->slots, [](Slot& s) { return s.sensor->needs_every_step(); });
  mark_stale(sorted);
  compute(due->slots, sorted, Change::kReset, key);
}

void Simulation::forward(worlds::WorldIds ids) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Borrowed due(*this);
  collect(due->slots, [](Slot& s) { return s.sensor->needs_every_step(); });
  mark_stale(sorted);
  compute(due->slots, sorted, Change::kForward);
  // Sensors that cast rays from earlier poses store the written one, even if they are not read now.
  Borrowed timed(*this);
  for (const auto& slot : slots_) {
    if (slot->casts && slot->sensor->wants_substep()) timed->slots.push_back(slot.get());
  }
  if (timed->slots.empty()) return;
  Hooks hooks(*this, timed->slots, 0);
  worlds_->visit(sorted, hooks);
}

void Simulation::step_raw(int substeps) {
  invalidate();
  worlds_->step_raw(substeps);
}

void Simulation::update_sensors(double dt) {
  Hooks hooks(*this, Hooks::Only::kSubstep, dt);
  invalidate();
  worlds_->visit(worlds::all_worlds, hooks);
}

void Simulation::reset_sensors(worlds::WorldIds ids) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Hooks hooks(*this, Hooks::Only::kReset);
  mark_stale(sorted);
  worlds_->visit(sorted, hooks);
}

Simulation::Cost Simulation::cost(const Sensor& sensor) const {
  const Slot& slot = slot_of(sensor);
  return {std::accumulate(slot.compute_s.begin(), slot.compute_s.end(), 0.0), slot.cast_s};
}

double Simulation::ray_scene_cost() const {
  return std::accumulate(rays_s_.begin(), rays_s_.end(), 0.0);
}

void Simulation::invalidate(worlds::WorldIds ids) { mark_stale(worlds_->checked_ids(ids)); }

void Simulation::refresh(std::span<Sensor* const> sensors, worlds::WorldIds ids) {
  make_current(sensors, ids);
  // only after they were computed successfully
  for (const Sensor* sensor : sensors) slot_of(*sensor).read = true;
}

void Simulation::make_current(std::span<Sensor* const> sensors, worlds::WorldIds ids) {
  Borrowed due(*this);
  for (const Sensor* sensor : sensors) {
    slot_of(*sensor).wanted = true;
  }
  collect(due->slots, [](const Slot&) { return false; });
  worlds_->checked_ids(ids, due->ids);
  std::erase_if(due->ids, [&](int w) {
    return std::ranges::all_of(due->slots,
                               [&](const Slot* slot) { return slot->computed[w] == version_[w]; });
  });
  if (!due->ids.empty()) compute(due->slots, due->ids, Change::kNone);
}

class Simulation::DrawHooks final : public worlds::WorldHooks {
 public:
  DrawHooks(std::span<Sensor* const> sensors, DebugShapes& shapes)
      : sensors_(sensors), shapes_(shapes) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override {
    for (Sensor* sensor : sensors_) guarded(*sensor, [&] { sensor->draw(world, shapes_); });
  }

 private:
  std::span<Sensor* const> sensors_;
  DebugShapes& shapes_;
};

DebugShapes Simulation::draw(int world, std::span<Sensor* const> sensors) {
  std::vector<Sensor*> chosen(sensors.begin(), sensors.end());
  if (sensors.empty()) {
    for (auto& slot : slots_) {
      if (slot->sensor->debug_vis()) chosen.push_back(slot->sensor);
    }
  }
  const std::vector<int> ids = worlds_->checked_ids(std::span(&world, 1));
  DebugShapes shapes(model()->stat.meansize);
  if (chosen.empty()) return shapes;
  make_current(chosen, ids);
  DrawHooks hooks(chosen, shapes);
  worlds_->visit(ids, hooks);
  return shapes;
}

}  // namespace mjsense::sim
