// SPDX-License-Identifier: Apache-2.0
// Controller `joint_position_relative`: commands are displacements, target = position + command. A
// joint whose command is below the threshold keeps its target, so that it does not sag step by step
// under a load.
#include <cmath>

#include "mjsense_tasks/robots/controllers/actuated.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

namespace mjsense::tasks::robots {
namespace {

class JointPositionRelative final : public ChangeController {
 public:
  JointPositionRelative(const JointPositionRelativeCfg& cfg, const MoveGroup& group,
                        const ControllerInit& init)
      : ChangeController(group, init), cfg_(cfg) {
    need_position_servos(init, "joint_position_relative");
  }
  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_unit += ", relative";
    for (int i = 0; i < size(); ++i) {
      const double span = group_.ctrl_high[i] - group_.ctrl_low[i];
      group.command_low[i] = -span;
      group.command_high[i] = span;
    }
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override {
    for (int i = 0; i < size(); ++i) {
      if (std::abs(command[i]) >= cfg_.threshold)
        target[i] = clip(i, position(world, i) + command[i]);
    }
  }

 private:
  JointPositionRelativeCfg cfg_;
};

}  // namespace

std::unique_ptr<Controller> make_kind(const JointPositionRelativeCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<JointPositionRelative>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
