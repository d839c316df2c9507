// SPDX-License-Identifier: Apache-2.0
// Controller `none`: the group takes no command and keeps its start position.
#include "mjsense_tasks/robots/controllers/actuated.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

namespace mjsense::tasks::robots {
namespace {

class NoController final : public ActuatedController {
 public:
  using ActuatedController::ActuatedController;
  void describe(MoveGroup& /*group*/) const override {}
  void hold(const World& /*world*/, std::span<double> /*target*/) override {}
  void command(const World& /*world*/, std::span<const double> /*command*/,
               std::span<double> /*target*/) override {}
  void begin(const World& /*world*/, std::span<const double> /*target*/,
             const StateRow& /*state*/) override {}
};

}  // namespace

std::unique_ptr<Controller> make_kind(const NoControllerCfg& /*cfg*/, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<NoController>(group, init);
}

}  // namespace mjsense::tasks::robots
