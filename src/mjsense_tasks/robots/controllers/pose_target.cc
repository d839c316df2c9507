// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/controllers/pose_target.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"

namespace mjsense::tasks::robots {

Pose commanded_pose(std::span<const double> command, const std::string& context) {
  const Quat q = quat(command.data() + 3);
  const double size = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
  if (!(size > 1e-12)) {
    throw ValueError(
        fmt::format("{}: the quaternion ({}, {}, {}, {}) of the command is not a rotation; a "
                    "command is x, y, z and the quaternion w, x, y, z",
                    context, q.w, q.x, q.y, q.z));
  }
  return {vec3(command.data()), normalized(q)};
}

PoseTarget::PoseTarget(int mocap, const Pose& base_to_mocap, double max_speed, double max_turn,
                       const ControllerInit& init)
    : mocap_(mocap),
      base_to_mocap_(base_to_mocap),
      max_step_(max_speed * init.periods.ctrl_dt),
      max_turn_(max_turn * init.periods.ctrl_dt),
      context_(init.context),
      goals_(init.num_worlds) {}

void PoseTarget::describe(MoveGroup& group) const {
  group.command_size = 7;
  group.command_unit = "m, wxyz";
  group.command_low = {-mjMAXVAL, -mjMAXVAL, -mjMAXVAL, -1, -1, -1, -1};
  group.command_high = {mjMAXVAL, mjMAXVAL, mjMAXVAL, 1, 1, 1, 1};
  group.target_size = 0;  // the target is a pose, not joint positions
}

void PoseTarget::hold(const World& world, std::span<double> /*target*/) {
  goals_[world.id].given = false;
}

Pose PoseTarget::base_at(const mjtNum* mocap_pos, const mjtNum* mocap_quat) const {
  return Pose{vec3(mocap_pos + 3 * mocap_), quat(mocap_quat + 4 * mocap_)} *
         inverse(base_to_mocap_);
}

void PoseTarget::keep(const World& world, std::span<const double> /*target*/,
                      std::span<double> command) const {
  write_pose(base_at(world.data->mocap_pos, world.data->mocap_quat), command.data());
}

void PoseTarget::command(const World& world, std::span<const double> command,
                         std::span<double> /*target*/) {
  goals_[world.id] = {true, commanded_pose(command, context_)};
}

void PoseTarget::begin(const World& world, std::span<const double> /*target*/,
                       const StateRow& state) {
  compute(world, 0, state);
}

mjtStage PoseTarget::compute(const World& world, int /*index*/, const StateRow& state) {
  const Goal& goal = goals_[world.id];
  if (!goal.given) return mjSTAGE_ACC;
  const Pose now = base_at(state.mocap_pos, state.mocap_quat);
  const Vec3 offset = goal.base.p - now.p;
  const Vec3 turn = log3(conjugate(now.q) * goal.base.q);
  // Translation and rotation take the same number of control steps.
  const double far = std::max(norm(offset) / max_step_, norm(turn) / max_turn_);
  if (far <= 1.0) {
    write(goal.base, state);
  } else {
    write({now.p + (1.0 / far) * offset, normalized(now.q * exp3((1.0 / far) * turn))}, state);
  }
  return mjSTAGE_NONE;
}

void PoseTarget::write(const Pose& base, const StateRow& state) const {
  const Pose at = base * base_to_mocap_;
  write_vec(at.p, state.mocap_pos + 3 * mocap_);
  write_quat(at.q, state.mocap_quat + 4 * mocap_);
}

}  // namespace mjsense::tasks::robots
