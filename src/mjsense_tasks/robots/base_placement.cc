// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/base_placement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::robots {
namespace {

// m and rad; two poses that are closer than this are the same.
constexpr double kSame = 1e-9;

double distance(const Pose& a, const Pose& b) {
  return std::max(norm(a.p - b.p), angle_between(a.q, b.q));
}

}  // namespace

BasePlacement::BasePlacement(const mjModel* m, int base_body, std::span<const int> joints,
                             std::string context)
    : context_(std::move(context)), base_name_(scene::name_of(m, mjOBJ_BODY, base_body)) {
  std::vector<int> path;
  for (int b = base_body; b != 0; b = m->body_parentid[b]) {
    const int joint = m->body_jntnum[b] > 0 ? m->body_jntadr[b] : -1;
    if (joint >= 0 && m->jnt_type[joint] == mjJNT_FREE && b == base_body) {
      free_qpos_ = m->jnt_qposadr[joint];
      free_dof_ = m->jnt_dofadr[joint];
      return;
    }
    if (m->body_mocapid[b] >= 0) {
      mocap_ = m->body_mocapid[b];
      is_mocap_ = b == base_body;
      root_ = body_frame(m, b);
      break;
    }
    path.push_back(b);
  }
  std::ranges::reverse(path);
  Pose fixed;
  for (int b : path) {
    fixed = fixed * body_frame(m, b);
    for (int j = m->body_jntadr[b]; j < m->body_jntadr[b] + m->body_jntnum[b]; ++j) {
      const int type = m->jnt_type[j];
      if (type != mjJNT_SLIDE && type != mjJNT_HINGE) {
        fault_ = fmt::format("the joint '{}' that moves it is neither a slide nor a hinge",
                             scene::name_of(m, mjOBJ_JOINT, j));
        return;
      }
      if (std::ranges::find(joints, j) == joints.end()) {
        fault_ = fmt::format("the joint '{}' that moves it belongs to no move group of kind 'base'",
                             scene::name_of(m, mjOBJ_JOINT, j));
        return;
      }
      links_.emplace_back(m, j, fixed);
      qpos_.push_back(m->jnt_qposadr[j]);
      dofs_.push_back(m->jnt_dofadr[j]);
      fixed = Pose{};
    }
  }
  tail_ = fixed;
}

Pose BasePlacement::from_root(const StateRow& state) const {
  Pose pose;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    pose = pose * links_[i].fixed;
    links_[i].move(pose, state.qpos[qpos_[i]]);
  }
  return pose * tail_;
}

// Sets the joints to bring the base as near to the pose as they can: hinges first, since slides
// cannot change the orientation; then the slides for the position.
void BasePlacement::move_joints(const StateRow& state, const Pose& base) const {
  for (std::size_t i = 0; i < links_.size(); ++i) {
    state.qpos[qpos_[i]] = links_[i].zero;
    state.qvel[dofs_[i]] = 0;
  }
  for (const bool slide : {false, true}) {
    for (std::size_t i = 0; i < links_.size(); ++i) {
      if (links_[i].slide == slide) state.qpos[qpos_[i]] += missing_motion(state, i, base);
    }
  }
}

// Motion of joint i that brings the base nearest to the pose (rad or m).
double BasePlacement::missing_motion(const StateRow& state, std::size_t i, const Pose& base) const {
  // Pose of the frame in which the joint moves (its parent's motion included), world frame.
  Pose before = root_ * links_[0].fixed;
  for (std::size_t k = 0; k < i; ++k) {
    const Link& link = links_[k];
    if (!link.slide) before.q = before.q * axis_angle(link.axis, state.qpos[qpos_[k]] - link.zero);
    before = before * links_[k + 1].fixed;
  }
  const Vec3 axis = rotate(before.q, links_[i].axis);
  const Pose now = root_ * from_root(state);
  if (links_[i].slide) return dot(axis, base.p - now.p);
  const Quat missing = base.q * conjugate(now.q);
  const double along = missing.x * axis.x + missing.y * axis.y + missing.z * axis.z;
  return std::remainder(2 * std::atan2(along, missing.w), 2 * std::numbers::pi);
}

void BasePlacement::write(const StateRow& state, const Pose& base) const {
  if (free_qpos_ >= 0) {
    write_vec(base.p, state.qpos + free_qpos_);
    write_quat(base.q, state.qpos + free_qpos_ + 3);
    std::fill_n(state.qvel + free_dof_, 6, 0.0);
    return;
  }
  if (!fault_.empty())
    throw ValueError(
        fmt::format("{}: the base '{}' cannot be placed: {}", context_, base_name_, fault_));
  if (mocap_ >= 0 && is_mocap_) {
    write_vec(base.p, state.mocap_pos + 3 * mocap_);
    write_quat(base.q, state.mocap_quat + 4 * mocap_);
    return;
  }
  if (mocap_ >= 0 && links_.empty()) {
    const Pose root = base * inverse(tail_);
    write_vec(root.p, state.mocap_pos + 3 * mocap_);
    write_quat(root.q, state.mocap_quat + 4 * mocap_);
    return;
  }
  move_joints(state, base);
  const Pose root = base * inverse(from_root(state));
  const bool stands = distance(root, root_) < kSame;
  if (mocap_ >= 0) {
    const Pose& written = stands ? root_ : root;
    write_vec(written.p, state.mocap_pos + 3 * mocap_);
    write_quat(written.q, state.mocap_quat + 4 * mocap_);
  } else if (!stands) {
    const Pose now = root_ * from_root(state);
    throw ValueError(fmt::format(
        "{}: the base '{}' cannot be placed at ({:g}, {:g}, {:g}), rotation ({:g}, {:g}, {:g}, "
        "{:g}): it is fixed to the world, and the nearest position is ({:g}, {:g}, {:g}). Attach "
        "it with EntityCfg.mocap_base, make the base a mocap body, or give it a free joint",
        context_, base_name_, base.p.x, base.p.y, base.p.z, base.q.w, base.q.x, base.q.y, base.q.z,
        now.p.x, now.p.y, now.p.z));
  }
}

}  // namespace mjsense::tasks::robots
