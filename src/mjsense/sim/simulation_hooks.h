// SPDX-License-Identifier: Apache-2.0
#pragma once
// Calls of the sensors in the parallel pass over the worlds.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <span>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/sim/sensor_errors.h"
#include "mjsense/sim/simulation.h"
#include "mjsense/sim/simulation_slots.h"

namespace mjsense::sim {

// Measures seconds since its construction. If off, returns 0 and does not read the clock, which
// takes 25 ns, as much as a small sensor.
class Timer {
 public:
  explicit Timer(bool on) : on_(on) {
    if (on_) start_ = std::chrono::steady_clock::now();
  }
  double seconds() const {
    if (!on_) return 0.0;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  bool on_;
  std::chrono::steady_clock::time_point start_;
};

// Sensor callbacks of the parallel pass of MuJoCo's threads over the worlds.
class Simulation::Hooks final : public worlds::WorldHooks {
 public:
  enum class Only { kNothing, kSubstep, kReset };
  Hooks(Simulation& sim, std::span<Slot* const> slots, int phase)
      : sim_(sim), slots_(slots), phase_(phase) {
    for (const Slot* s : slots) {
      if (s->phase != phase) continue;
      rays_ |= s->sensor->stage() == Stage::kCast;
      stage_ = std::max(stage_, s->needs);
    }
    if (rays_) stage_ = std::max(stage_, mjSTAGE_POS);
  }

  // Calls only substep() or reset() of every sensor.
  Hooks(Simulation& sim, Only only, double elapsed = 0.0)
      : sim_(sim),
        only_(only),
        elapsed_(elapsed),
        stage_(only == Only::kSubstep ? sim.substep_stage_ : mjSTAGE_ACC) {}

  mjtStage stage() const override { return stage_; }
  mjtStage substep_stage() const override { return sim_.substep_stage_; }
  bool wants_substep() const override { return sim_.any_substep_; }

  int control_every() const override { return sim_.control_every_; }
  mjtStage control(const World& world, int index) override { return sim_.control_(world, index); }

  void substep(const World& world) override {
    for (auto& slot : sim_.slots_) {
      if (slot->sensor->wants_substep())
        guarded(*slot->sensor, [&] { slot->sensor->substep(world); });
    }
  }

  void reset(const World& world) override {
    for (auto& slot : sim_.slots_) guarded(*slot->sensor, [&] { slot->sensor->reset(world); });
  }

  void refreshed(const World& world) override {
    if (only_ == Only::kSubstep) {
      World by_hand = world;
      by_hand.elapsed = elapsed_;
      return substep(by_hand);
    }
    if (only_ == Only::kReset) return reset(world);
    const std::int64_t version = sim_.version_[world.id];
    if (rays_ && sim_.rays_version_[world.id] != version) {
      const Timer timer(sim_.measure_cost_);
      sim_.rays_->update(world);
      sim_.rays_s_[world.id] += timer.seconds();
      sim_.rays_version_[world.id] = version;
    }
    for (Slot* slot : slots_) {
      if (slot->phase != phase_ || slot->computed[world.id] == version) continue;
      const Timer timer(sim_.measure_cost_);
      guarded(*slot->sensor, [&] { slot->sensor->compute(world); });
      slot->compute_s[world.id] += timer.seconds();
      if (!slot->casts) slot->computed[world.id] = version;
    }
  }

 private:
  Simulation& sim_;
  std::span<Slot* const> slots_;
  int phase_ = 0;
  Only only_ = Only::kNothing;
  double elapsed_ = 0.0;
  mjtStage stage_ = mjSTAGE_NONE;
  bool rays_ = false;
};

}  // namespace mjsense::sim
