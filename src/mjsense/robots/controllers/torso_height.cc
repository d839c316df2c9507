// SPDX-License-Identifier: Apache-2.0
// One number bends hip, knees and ankle together, so that a torso rises and sinks upright:
// positions = ratio * command.
#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/robots/controllers/actuated.h"
#include "mjsense/robots/controllers/kinds.h"

namespace mjsense {
namespace {

class TorsoHeight final : public ActuatedController {
 public:
  TorsoHeight(const TorsoHeightCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : ActuatedController(group, init), cfg_(cfg) {
    need_position_servos(init, "torso_height", static_cast<int>(cfg.ratio.size()));
    if (!(cfg.range[0] < cfg.range[1])) {
      throw ValueError(fmt::format("{}: controller.range is {} .. {}: must be ascending",
                                   init.place, cfg.range[0], cfg.range[1]));
    }
  }
  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_size = 1;
    group.command_low = {cfg_.range[0]};
    group.command_high = {cfg_.range[1]};
  }
  void command(const World& /*world*/, std::span<const double> command,
               std::span<double> target) override {
    const double height = std::clamp(command[0], cfg_.range[0], cfg_.range[1]);
    for (int i = 0; i < size(); ++i) target[i] = clip(i, cfg_.ratio[i] * height);
  }

 private:
  TorsoHeightCfg cfg_;
};

}  // namespace

std::unique_ptr<Controller> make_kind(const TorsoHeightCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<TorsoHeight>(cfg, group, init);
}

}  // namespace mjsense
