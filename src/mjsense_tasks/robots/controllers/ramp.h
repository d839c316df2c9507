// SPDX-License-Identifier: Apache-2.0
#pragma once
// Linear ramp of controls from their current values to a target over one policy step.

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mjsense_tasks/robots/controllers/actuated.h"

namespace mjsense::tasks::robots {

class Ramp {
 public:
  Ramp(const ControlPeriods& periods, int num_worlds, std::vector<int> actuators)
      : steps_(std::max(1L, std::lround(periods.policy_dt / periods.ctrl_dt))),
        actuators_(std::move(actuators)),
        from_(num_worlds * actuators_.size()),
        to_(from_.size()) {}

  // Starts a ramp to `target` and writes the controls of the first control step.
  void begin(int world, std::span<const double> target, const StateRow& state) {
    for (std::size_t i = 0; i < actuators_.size(); ++i) {
      from_[world * actuators_.size() + i] = state.ctrl[actuators_[i]];
      to_[world * actuators_.size() + i] = target[i];
    }
    write(world, 0, state);
  }
  // Writes the controls of control step `index`; the last one equals the target.
  mjtStage write(int world, int index, const StateRow& state) const {
    const double s = std::min(1.0, (index + 1.0) / static_cast<double>(steps_));
    for (std::size_t i = 0; i < actuators_.size(); ++i) {
      const double from = from_[world * actuators_.size() + i];
      const double to = to_[world * actuators_.size() + i];
      state.ctrl[actuators_[i]] = s == 1 ? to : from + s * (to - from);
    }
    return mjSTAGE_VEL;
  }

 private:
  long steps_;  // control steps per policy step
  std::vector<int> actuators_;
  std::vector<double> from_, to_;  // [B, n]
};

// Base class of controllers whose controls are their targets, set at once or along a ramp.
class RampedController : public ActuatedController {
 public:
  RampedController(bool ramp, const MoveGroup& group, const ControllerInit& init)
      : ActuatedController(group, init) {
    if (ramp) ramp_.emplace(init.periods, init.num_worlds, group.actuators);
  }
  void begin(const World& world, std::span<const double> target, const StateRow& state) override {
    if (!ramp_) return ActuatedController::begin(world, target, state);
    ramp_->begin(world.id, target, state);
  }
  bool every_step() const override { return ramp_.has_value(); }
  mjtStage compute(const World& world, int index, const StateRow& state) override {
    return ramp_->write(world.id, index, state);
  }

 private:
  std::optional<Ramp> ramp_;
};

}  // namespace mjsense::tasks::robots
