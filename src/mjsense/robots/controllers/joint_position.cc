// SPDX-License-Identifier: Apache-2.0
// Commands are what the actuators take, clipped to their ranges.
#include <optional>

#include "mjsense/robots/controllers/actuated.h"
#include "mjsense/robots/controllers/kinds.h"
#include "mjsense/robots/controllers/ramp.h"

namespace mjsense {
namespace {

class JointPosition final : public ActuatedController {
 public:
  JointPosition(const JointPositionCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : ActuatedController(group, init) {
    if (cfg.ramp) ramp_.emplace(init.periods, init.num_worlds, group.actuators);
  }
  void command(const World& /*world*/, std::span<const double> command,
               std::span<double> target) override {
    for (int i = 0; i < size(); ++i) target[i] = clip(i, command[i]);
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

}  // namespace

std::unique_ptr<Controller> make_kind(const JointPositionCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<JointPosition>(cfg, group, init);
}

}  // namespace mjsense
