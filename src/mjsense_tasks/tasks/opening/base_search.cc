// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/base_search.h"

#include <cmath>
#include <utility>

#include "mjsense_tasks/robots/start_positions.h"

namespace mjsense::tasks {

BaseSearch::BaseSearch(const robots::Robot& robot, const HandleReach& reach,
                       HandleReach::Start empty, const Pose& usual, BaseSearchCfg cfg)
    : robot_(robot), reach_(reach), empty_(std::move(empty)), usual_(usual), cfg_(cfg) {}

HandleReach::Start BaseSearch::placed(const HandleReach::Start& start, const Pose& base) const {
  HandleReach::Start out = start;
  std::vector<double> qvel(start.model.nv), ctrl(start.model.nu);
  const bool mocap = start.model.nmocap > 0;
  const robots::StateRow row{out.qpos.data(), qvel.data(), ctrl.data(),
                             mocap ? out.mocap_pos.data() : nullptr,
                             mocap ? out.mocap_quat.data() : nullptr};
  Rng none(0, 0, 0, 0);
  robot_.write_start(row, base, none);
  robots::write_start_positions(robot_, out.qpos.data());
  return out;
}

// For a floating gripper: in front of the handle, oriented as for a grasp.
Pose BaseSearch::before(const Pose& body, const Articulation& one, double distance, double aside,
                        double turn) const {
  const OrientedHand& hand = reach_.hands()[0];
  const double opening = robot_.groups()[hand.gripper].max_opening;
  const std::vector<HandleGrasp> grasps = propose_handle_grasps(one.handle, body, opening);
  if (grasps.empty()) return usual_;
  const Vec3 back{0.5 * aside, 0, -(0.1 + 0.5 * distance)};  // closer, because there is no arm
  return reach_.base_with(
      hand, grasps[0].pose * Pose{back, axis_angle({0, 1, 0}, turn)} * Pose{{}, hand.turn});
}

BasePlaces BaseSearch::places(const Articulation& one, double from, double to) const {
  {
    const std::lock_guard lock(mutex_);
    const auto known = known_.find(one.joint);
    if (known != known_.end()) return known->second;
  }
  BasePlaces found{search(one, from, to, false), false};
  if (found.at.empty() && reach_.drives()) found = {search(one, from, to, true), true};
  const std::lock_guard lock(mutex_);
  return known_.try_emplace(one.joint, std::move(found)).first->second;
}

std::vector<Pose> BaseSearch::search(const Articulation& one, double from, double to,
                                     bool driving) const {
  // The handle's position and outward direction in the horizontal plane.
  const Pose body = reach_.body_pose(empty_, one, from);
  const Vec3 handle = body * one.handle.middle, out = rotate(body.q, one.handle.outward);
  const double flat = std::hypot(out.x, out.y);
  const Vec3 away = flat > 0.3 ? Vec3{out.x / flat, out.y / flat, 0} : Vec3{-1, 0, 0};
  const Vec3 side{-away.y, away.x, 0};
  Rng rng(0, 0, stream_of("opening/base"), static_cast<std::uint64_t>(one.joint));
  std::vector<Pose> found;
  for (int i = 0; i < cfg_.candidates && static_cast<int>(found.size()) < cfg_.wanted; ++i) {
    Pose base = usual_;
    const bool floats = !reach_.hands().empty() && reach_.hands()[0].floats();
    if (i > 0 || floats) {
      const double distance = rng.uniform(cfg_.nearest, cfg_.farthest),
                   aside = rng.uniform(-cfg_.aside, cfg_.aside),
                   turn = rng.uniform(-cfg_.turn, cfg_.turn);
      const Vec3 at = handle + distance * away + aside * side;
      base.p = {at.x, at.y, usual_.p.z};
      const Vec3 look = handle + -0.3 * away - at;
      base.q = axis_angle({0, 0, 1}, std::atan2(look.y, look.x) + turn);
      if (floats) base = before(body, one, distance, aside, turn);
    }
    const HandleReach::Start there = placed(empty_, base);
    if (!reach_.is_collision_free(there)) continue;
    if (reach_.find(there, one, from, to, cfg_.grasps, driving)) found.push_back(base);
  }
  return found;
}

}  // namespace mjsense::tasks
