// SPDX-License-Identifier: Apache-2.0
// Controller `torso_height`: one value moves hip, knees and ankle together, so that a torso moves
// up and down upright: positions = ratio * command.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense_tasks/robots/controllers/actuated.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

namespace mjsense::tasks::robots {
namespace {

class TorsoHeight final : public ActuatedController {
 public:
  TorsoHeight(const TorsoHeightCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : ActuatedController(group, init), cfg_(cfg) {
    need_position_servos(init, "torso_height", static_cast<int>(cfg.ratio.size()));
    if (!(cfg.range[0] < cfg.range[1])) {
      throw ValueError(fmt::format("{}: controller.range is {} .. {}: must be ascending",
                                   init.context, cfg.range[0], cfg.range[1]));
    }
  }
  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_size = 1;
    group.command_low = {cfg_.range[0]};
    group.command_high = {cfg_.range[1]};
  }
  void keep(const World& /*world*/, std::span<const double> target,
            std::span<double> command) const override {
    command[0] = height_of(target);
  }
  // A command equal to the current height changes no target, even if the joints do not have the
  // configured ratio.
  void command(const World& /*world*/, std::span<const double> command,
               std::span<double> target) override {
    const double height = std::clamp(command[0], cfg_.range[0], cfg_.range[1]);
    if (std::abs(height - height_of(target)) < kSame) return;
    for (int i = 0; i < size(); ++i) target[i] = clip(i, cfg_.ratio[i] * height);
  }

 private:
  static constexpr double kSame = 1e-6;  // rad; commands may come as float32

  // The height whose joint positions are nearest to the targets (least squares).
  double height_of(std::span<const double> target) const {
    double along = 0, square = 0;
    for (int i = 0; i < size(); ++i) {
      along += cfg_.ratio[i] * target[i];
      square += cfg_.ratio[i] * cfg_.ratio[i];
    }
    return std::clamp(square > 0 ? along / square : 0.0, cfg_.range[0], cfg_.range[1]);
  }

  TorsoHeightCfg cfg_;
};

}  // namespace

std::unique_ptr<Controller> make_kind(const TorsoHeightCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<TorsoHeight>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
