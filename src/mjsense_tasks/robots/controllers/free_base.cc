// SPDX-License-Identifier: Apache-2.0
// Controller `free_base`: commands are poses of a floating base, x, y, z (m) and a quaternion
// (wxyz), world frame. A mocap body moves there and pulls the base with a weld constraint.
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"
#include "mjsense_tasks/robots/controllers/pose_target.h"

namespace mjsense::tasks::robots {
namespace {

class FreeBase final : public PoseTarget {
 public:
  FreeBase(int qpos, int mocap, const Pose& base_to_mocap, const FreeBaseCfg& cfg,
           const ControllerInit& init)
      : PoseTarget(mocap, base_to_mocap, cfg.max_speed, cfg.max_turn, init), qpos_(qpos) {}
  void start(const StateRow& state) const override {
    write({vec3(state.qpos + qpos_), quat(state.qpos + qpos_ + 3)}, state);
  }

 private:
  int qpos_;
};

}  // namespace

std::unique_ptr<Controller> make_kind(const FreeBaseCfg& cfg, const MoveGroup& /*group*/,
                                      const ControllerInit& init) {
  const mjModel* m = init.model;
  const int base = init.base_body;
  const int joint = m->body_jntnum[base] == 1 ? m->body_jntadr[base] : -1;
  if (joint < 0 || m->jnt_type[joint] != mjJNT_FREE) {
    throw ValueError(
        fmt::format("{}: the controller 'free_base' needs a free joint; the base '{}' "
                    "has none",
                    init.context, scene::name_of(m, mjOBJ_BODY, base)));
  }
  const int target = scene::resolve(m, mjOBJ_BODY, init.prefix + cfg.target, init.context);
  if (m->body_mocapid[target] < 0) {
    throw ValueError(
        fmt::format("{}: the target '{}' is not a mocap body", init.context, cfg.target));
  }
  const double* q0 = m->qpos0 + m->jnt_qposadr[joint];
  const Pose X_WB{vec3(q0), quat(q0 + 3)};
  const Pose X_WM = body_frame(m, target);
  return std::make_unique<FreeBase>(m->jnt_qposadr[joint], m->body_mocapid[target],
                                    inverse(X_WB) * X_WM, cfg, init);
}

}  // namespace mjsense::tasks::robots
