// SPDX-License-Identifier: Apache-2.0
#include "mjsense/robots/controllers/controller_kinds.h"

namespace mjsense {

std::unique_ptr<Controller> make_controller(const ControllerCfg& cfg, const MoveGroup& group,
                                            const ControllerInit& init) {
  return std::visit([&](const auto& kind) { return make_kind(kind, group, init); }, cfg);
}

}  // namespace mjsense
