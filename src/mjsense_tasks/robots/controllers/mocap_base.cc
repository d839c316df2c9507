// SPDX-License-Identifier: Apache-2.0
// Controller `mocap_base`: commands are poses of a base that is a mocap body, x, y, z (m) and a
// quaternion (wxyz), world frame.
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"
#include "mjsense_tasks/robots/controllers/pose_target.h"

namespace mjsense::tasks::robots {

std::unique_ptr<Controller> make_kind(const MocapBaseCfg& cfg, const MoveGroup& /*group*/,
                                      const ControllerInit& init) {
  const int mocap = init.model->body_mocapid[init.base_body];
  if (mocap < 0) {
    throw ValueError(
        fmt::format("{}: the controller 'mocap_base' needs a mocap body; the base '{}' is not one",
                    init.context, scene::name_of(init.model, mjOBJ_BODY, init.base_body)));
  }
  return std::make_unique<PoseTarget>(mocap, Pose{}, cfg.max_speed, cfg.max_turn, init);
}

}  // namespace mjsense::tasks::robots
