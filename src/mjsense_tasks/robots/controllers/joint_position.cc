// SPDX-License-Identifier: Apache-2.0
// Controller `joint_position`: commands are the actuators' controls, clipped to their ranges.

#include "mjsense_tasks/robots/controllers/controller_kinds.h"
#include "mjsense_tasks/robots/controllers/ramp.h"

namespace mjsense::tasks::robots {
namespace {

class JointPosition final : public RampedController {
 public:
  JointPosition(const JointPositionCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : RampedController(cfg.ramp, group, init) {}
  void describe(MoveGroup& group) const override {
    RampedController::describe(group);
    group.commands_are_targets = true;
  }
  void command(const World& /*world*/, std::span<const double> command,
               std::span<double> target) override {
    for (int i = 0; i < size(); ++i) target[i] = clip(i, command[i]);
  }
};

}  // namespace

std::unique_ptr<Controller> make_kind(const JointPositionCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<JointPosition>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
