// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensors of a simulation with the state of their rows, and its reused buffers.

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "mjsense/core/control_step.h"
#include "mjsense/core/sensor.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sim {

// A sensor and the state of its rows.
struct Simulation::Slot {
  Sensor* sensor;
  std::vector<Slot*> inputs;
  // by world: version_ of the state that the row was computed from
  std::vector<std::int64_t> computed;
  std::vector<double> compute_s;  // by world
  double cast_s = 0;
  mjtStage needs = mjSTAGE_ACC;
  ControlStepListener* listener = nullptr;  // the sensor, if it is a ControlStepListener
  int phase = 0;        // number of earlier passes: 1 + the phase of an input that casts
  bool casts = false;   // stage kCast or kBatch: finished by cast()
  bool read = false;    // since the last step
  bool wanted = false;  // temporary flag of collect()
};

struct Simulation::Scratch {
  std::vector<Slot*> slots;
  std::vector<int> ids;
};

class Simulation::Borrowed {
 public:
  explicit Borrowed(Simulation& sim) : sim_(sim) {
    if (sim.scratch_.empty()) {
      scratch_ = std::make_unique<Scratch>();
    } else {
      scratch_ = std::move(sim.scratch_.back());
      sim.scratch_.pop_back();
    }
    scratch_->slots.clear();
    scratch_->ids.clear();
  }
  ~Borrowed() { sim_.scratch_.push_back(std::move(scratch_)); }
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  Scratch* operator->() { return scratch_.get(); }

 private:
  Simulation& sim_;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace mjsense::sim
