// SPDX-License-Identifier: Apache-2.0
// Controller `holonomic_base`: commands are poses on the floor, x, y (m) and yaw (rad), for two
// slides and a hinge. The base takes the shorter direction to a yaw.
#include <cmath>
#include <numbers>

#include "mjsense_tasks/robots/action_noise.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"
#include "mjsense_tasks/robots/controllers/ramp.h"

namespace mjsense::tasks::robots {
namespace {

class HolonomicBase final : public RampedController {
 public:
  HolonomicBase(const HolonomicBaseCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : RampedController(cfg.ramp, group, init), cfg_(cfg) {
    need_position_servos(init, "holonomic_base", 3);
  }
  void describe(MoveGroup& group) const override {
    RampedController::describe(group);
    group.command_unit = group.target_unit = "m, m, rad";
    group.commands_are_targets = true;
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override {
    const double yaw = position(world, 2);
    target[0] = clip(0, command[0]);
    target[1] = clip(1, command[1]);
    target[2] = clip(2, yaw + std::remainder(command[2] - yaw, 2 * std::numbers::pi));
  }
  void disturb(const World& world, Rng& rng, std::span<double> target) override {
    for (int i = 0; i < 3; ++i) {
      const double limit = i < 2 ? cfg_.max_position_noise : cfg_.max_rotation_noise;
      const double deviation = cfg_.noise * std::abs(target[i] - position(world, i));
      target[i] = clip(i, target[i] + truncated_normal(rng, deviation, limit));
    }
  }

 private:
  HolonomicBaseCfg cfg_;
};

}  // namespace

std::unique_ptr<Controller> make_kind(const HolonomicBaseCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<HolonomicBase>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
