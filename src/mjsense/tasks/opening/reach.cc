// SPDX-License-Identifier: Apache-2.0
#include "mjsense/tasks/opening/reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense {
namespace {

constexpr std::array<double, 5> kTilts{0, 0.35, -0.35, 0.7, -0.7};  // rad, about the handle
constexpr std::array<double, 3> kTurns{0, 0.4, -0.4};               // rad, across the handle
constexpr std::array<double, 3> kPlaces{0, 0.45, -0.45};            // of its half length
constexpr int kOfRobot = 1 << 30;   // contact bit of the robot's geoms
constexpr double kBuiltSo = 0.002;  // m between links at the start
constexpr double kSideGap = 0.004;  // m, pads to the handle

// Fingers close along any direction across the approach: where the pads are, in the tool's frame.
Quat closing_turn(const MoveGroup& gripper, const mjModel* model) {
  if (gripper.pad_sites[0] < 0 || gripper.leaf_site < 0) return {};
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model), mj_deleteData);
  for (std::size_t i = 0; i < gripper.qpos.size(); ++i) {  // open: the range's wider end
    const int joint = gripper.joints[std::min(i, gripper.joints.size() - 1)];
    const double low = model->jnt_range[2 * joint], high = model->jnt_range[2 * joint + 1];
    if (model->jnt_type[joint] == mjJNT_SLIDE && model->jnt_limited[joint])
      data->qpos[gripper.qpos[i]] = std::abs(low) > std::abs(high) ? low : high;
  }
  mj_kinematics(model, data.get());
  const Pose tool = pose_from_mat(data->site_xpos + 3 * gripper.leaf_site,
                                  data->site_xmat + 9 * gripper.leaf_site);
  const Vec3 apart =
      rotate(conjugate(tool.q), vec3(data->site_xpos + 3 * gripper.pad_sites[1]) -
                                    vec3(data->site_xpos + 3 * gripper.pad_sites[0]));
  if (std::hypot(apart.x, apart.y) < 1e-4) return {};
  const double angle = 0.5 * std::numbers::pi - std::atan2(apart.y, apart.x);
  // A right angle or none: pads that are a little off the middle turn nothing.
  return axis_angle({0, 0, 1},
                    0.5 * std::numbers::pi * std::round(angle / (0.5 * std::numbers::pi)));
}

}  // namespace

std::vector<ArmAndHand> arms_with_hands(const Robot& robot, const mjModel* model) {
  std::vector<ArmAndHand> hands;
  const auto groups = robot.groups();
  for (int g = 0; g < static_cast<int>(groups.size()); ++g) {
    if (groups[g].kind != GroupKind::kGripper || groups[g].leaf_site < 0) continue;
    for (int a = 0; a < static_cast<int>(groups.size()); ++a) {
      if (groups[a].kind != GroupKind::kArm || groups[a].leaf_site < 0) continue;
      const bool same = groups[a].leaf_site == groups[g].leaf_site ||
                        is_below(model, groups[g].root_body, groups[a].root_body);
      if (!same) continue;
      hands.push_back({a, g, closing_turn(groups[g], model)});
      break;
    }
  }
  return hands;
}

std::vector<HandleGrasp> propose_handle_grasps(const Handle& handle, const Pose& body,
                                               double max_opening) {
  std::vector<HandleGrasp> grasps;
  const Vec3 along = rotate(body.q, handle.along), outward = rotate(body.q, handle.outward);
  const Vec3 middle = body * handle.middle;
  const bool knob = handle.half_along < 0.03;
  for (int side = 0; side < (knob ? 2 : 1); ++side) {
    // The fingers close across the bar; a knob may be taken both ways.
    const Vec3 bar = side == 0 ? along : normalized(cross(along, outward));
    const double across = side == 0 ? handle.half_across : handle.half_along;
    if (2 * across + 2 * kSideGap > max_opening) continue;
    for (double turn : kTurns) {
      for (double tilt : kTilts) {
        for (double place : kPlaces) {
          if (knob && place != 0) continue;
          Vec3 approach = rotate(axis_angle(bar, tilt), -outward);
          const Vec3 close = normalized(cross(bar, approach));
          approach = rotate(axis_angle(close, turn), approach);
          for (int flip = -1; flip <= 1; flip += 2) {
            const Vec3 y = static_cast<double>(flip) * close;
            const Vec3 position = middle + (place * handle.half_along) * bar;
            const double cost =
                std::abs(tilt) + 1.2 * std::abs(turn) + 0.3 * std::abs(place) + 0.1 * side;
            grasps.push_back(
                {{position, quat_from_columns(cross(y, approach), y, approach)}, cost});
          }
        }
      }
    }
  }
  std::ranges::stable_sort(grasps, {}, &HandleGrasp::cost);
  return grasps;
}

HandleReach::HandleReach(const mjModel* model, const Robot& robot, HandleReachCfg cfg)
    : own_(mj_copyModel(nullptr, model), mj_deleteModel),
      model_(own_.get()),
      robot_(robot),
      cfg_(cfg),
      hands_(arms_with_hands(robot, model)),
      of_robot_(model->nbody, 0),
      fixed_(model->nbody, 0),
      of_gripper_(model->nbody, -1),
      scratch_(own_.get()) {
  for (int b = 1; b < model->nbody; ++b) {
    of_robot_[b] = name_of(model, mjOBJ_BODY, b).starts_with(robot.prefix());
    // Links without a name belong to what carries them.
    if (!of_robot_[b] && name_of(model, mjOBJ_BODY, b).empty())
      of_robot_[b] = of_robot_[model->body_parentid[b]];
    for (const ArmAndHand& hand : hands_) {
      if (is_below(model, b, robot.groups()[hand.gripper].root_body)) of_gripper_[b] = hand.gripper;
    }
  }
  for (int b = 1; b < model->nbody; ++b)
    fixed_[b] = of_robot_[b] && (model->body_weldid[b] == 0 || b == robot.base_body());
  for (int g = 0; g < model->ngeom; ++g) {
    if (!of_robot_[model->geom_bodyid[g]]) continue;
    own_->geom_margin[g] = cfg_.clearance;
    if (!model->geom_contype[g] && !model->geom_conaffinity[g]) continue;
    // Its links touch each other here, whatever they do in the simulation.
    own_->geom_contype[g] |= kOfRobot;
    own_->geom_conaffinity[g] |= kOfRobot;
    own_->body_contype[model->geom_bodyid[g]] |= kOfRobot;
    own_->body_conaffinity[model->geom_bodyid[g]] |= kOfRobot;
  }
  // Links that meet at the start are built so.
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const auto& init = robot.cfg().groups[g].init;
    for (std::size_t i = 0; i < init.size(); ++i) data->qpos[robot.groups()[g].qpos[i]] = init[i];
  }
  mj_kinematics(model_, data);
  mj_collision(model_, data);
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.geom[0] < 0 || contact.geom[1] < 0 || contact.dist > kBuiltSo) continue;
    if (of_robot_[model_->geom_bodyid[contact.geom[0]]] &&
        of_robot_[model_->geom_bodyid[contact.geom[1]]])
      built_so_.emplace_back(contact.geom[0], contact.geom[1]);
  }
}

HandleReach::Start HandleReach::start_of(const mjData* d) const {
  return {{d->qpos, d->qpos + model_->nq},
          {d->mocap_pos, d->mocap_pos + 3 * model_->nmocap},
          {d->mocap_quat, d->mocap_quat + 4 * model_->nmocap}};
}

HandleReach::Start HandleReach::start_of(const StateRow& state) const {
  Start start{{state.qpos, state.qpos + model_->nq}, {}, {}};
  if (model_->nmocap > 0) {
    start.mocap_pos.assign(state.mocap_pos, state.mocap_pos + 3 * model_->nmocap);
    start.mocap_quat.assign(state.mocap_quat, state.mocap_quat + 4 * model_->nmocap);
  }
  return start;
}

void HandleReach::show(mjData* data, const RobotValues& values) const {
  for (const ArmAndHand& hand : hands_) {
    const auto& qpos = robot_.groups()[hand.arm].qpos;
    for (std::size_t i = 0; i < qpos.size(); ++i) data->qpos[qpos[i]] = values[hand.arm].values[i];
  }
}

// Everything else is as far from the robot; `hand` may touch what it holds.
bool HandleReach::free(mjData* data, double clearance, const Articulation* held,
                       const ArmAndHand* hand) const {
  mj_kinematics(model_, data);
  mj_collision(model_, data);
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.exclude || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    int mine = model_->geom_bodyid[contact.geom[0]], other = model_->geom_bodyid[contact.geom[1]];
    if (of_robot_[mine] && of_robot_[other]) {
      if (contact.dist > 0 || (of_gripper_[mine] >= 0 && of_gripper_[mine] == of_gripper_[other]))
        continue;
      const std::pair pair(contact.geom[0], contact.geom[1]);
      if (std::ranges::find(built_so_, pair) == built_so_.end()) return false;
    }
    if (of_robot_[mine] == of_robot_[other]) continue;
    if (!of_robot_[mine]) std::swap(mine, other);
    // What it stands on touches its base.
    if (contact.dist > (fixed_[mine] ? cfg_.contact : clearance)) continue;
    if (held && of_gripper_[mine] == hand->gripper && is_below(model_, other, held->body)) continue;
    return false;
  }
  return true;
}

bool HandleReach::stands_free(const Start& start) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  std::ranges::copy(start.qpos, data->qpos);
  std::ranges::copy(start.mocap_pos, data->mocap_pos);
  std::ranges::copy(start.mocap_quat, data->mocap_quat);
  const bool ok = free(data, cfg_.clearance, nullptr, nullptr);
  return ok;
}

Pose HandleReach::body_pose(const Start& start, const Articulation& one, double q) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  std::ranges::copy(start.qpos, data->qpos);
  std::ranges::copy(start.mocap_pos, data->mocap_pos);
  std::ranges::copy(start.mocap_quat, data->mocap_quat);
  data->qpos[one.qpos] = q;
  mj_kinematics(model_, data);
  const Pose pose{vec3(data->xpos + 3 * one.body), quat(data->xquat + 4 * one.body)};
  return pose;
}

// The arm goes straight from one configuration to the next; the first may be anywhere.
bool HandleReach::way_is_free(mjData* data, int arm, std::span<const RobotValues> way) const {
  const std::size_t n = robot_.groups()[arm].qpos.size();
  for (std::size_t k = way.size() - 1; k > 0; --k) {  // the end is the likeliest to be barred
    const auto &a = way[k - 1][arm].values, &b = way[k][arm].values;
    double most = 0;
    for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(b[i] - a[i]));
    const int steps = std::max(2, static_cast<int>(std::ceil(most / cfg_.step)));
    for (int s = steps; s > 0; --s) {
      RobotValues between = way[k];
      for (std::size_t i = 0; i < n; ++i)
        between[arm].values[i] = std::lerp(a[i], b[i], static_cast<double>(s) / steps);
      show(data, between);
      if (!free(data, cfg_.clearance, nullptr, nullptr)) return false;
    }
  }
  return true;
}

// What a start shows of the robot and of what it is to move.
struct HandleReach::Seen {
  RobotValues now;
  Pose to_base;  // X_BW
  Pose body;     // X_W of the handle's body
  Vec3 axis, anchor;
};

HandleReach::Seen HandleReach::see(mjData* data, const Start& start, const Articulation& one,
                                   double q) const {
  set(data, start, one, q);
  mj_kinematics(model_, data);
  const World world{.id = 0, .model = model_, .data = data};
  Seen seen;
  robot_.read_qpos(world, seen.now);
  seen.to_base = inverse(robot_.base_pose(world));
  seen.body = {vec3(data->xpos + 3 * one.body), quat(data->xquat + 4 * one.body)};
  seen.axis = vec3(data->xaxis + 3 * one.joint);
  seen.anchor = vec3(data->xanchor + 3 * one.joint);
  return seen;
}

void HandleReach::set(mjData* data, const Start& start, const Articulation& one, double q) const {
  std::ranges::copy(start.qpos, data->qpos);
  std::ranges::copy(start.mocap_pos, data->mocap_pos);
  std::ranges::copy(start.mocap_quat, data->mocap_quat);
  data->qpos[one.qpos] = q;
}

// The arm's positions while it has the handle, from `q` at the handle on.
bool HandleReach::go_along(const Seen& seen, const Articulation& one, double from, double to,
                           RobotValues q, HandleWay& way) const {
  for (int k = 0; k < cfg_.points; ++k) {
    const double joint = std::lerp(from, to, static_cast<double>(k) / (cfg_.points - 1));
    const Pose tool = seen.to_base * one.motion(from, joint, seen.axis, seen.anchor) * way.grasp;
    if (!robot_.ik(way.hand.arm, tool, q, Chain::kTracking)) return false;
    way.along.push_back(q);
  }
  return true;
}

bool HandleReach::try_grasp(mjData* data, const Start& start, const Seen& seen,
                            const Articulation& one, double from, double to, HandleWay& way) const {
  const int arm = way.hand.arm;
  way.pregrasp = seen.to_base * way.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  // From the posture that arms begin with, so that a little noise on it changes nothing.
  RobotValues before = seen.now;
  before[arm].set(robot_.cfg().groups[arm].init);
  if (before[arm].size != seen.now[arm].size) before[arm] = seen.now[arm];
  if (!robot_.ik(arm, way.pregrasp, before, 2 * Chain::kTracking)) return false;
  if (!go_along(seen, one, from, to, before, way)) return false;
  // It can reach all that; is anything in the way?
  for (std::size_t k = 0; k < way.along.size(); ++k) {
    set(data, start, one, std::lerp(from, to, static_cast<double>(k) / (cfg_.points - 1)));
    show(data, way.along[k]);
    if (!free(data, cfg_.contact, &one, &way.hand)) return false;
  }
  set(data, start, one, from);
  way.go = {seen.now, before};
  bool ok = way_is_free(data, arm, way.go);
  for (std::size_t k = 0; k < cfg_.detours.size() && !ok; ++k) {
    RobotValues by = before;
    const Pose back = way.pregrasp * Pose{{0, 0, -cfg_.detours[k]}, {}};
    if (!robot_.ik(arm, back, by, Chain::kTracking)) continue;
    way.go = {seen.now, by, before};
    ok = way_is_free(data, arm, way.go);
  }
  return ok;
}

std::optional<HandleWay> HandleReach::find(const Start& start, const Articulation& one, double from,
                                           double to, int most_tries) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  const Seen seen = see(data, start, one, from);
  std::optional<HandleWay> found;
  for (const ArmAndHand& hand : hands_) {
    int tries = 0;
    const double opening = robot_.groups()[hand.gripper].max_opening;
    for (const HandleGrasp& grasp : propose_handle_grasps(one.handle, seen.body, opening)) {
      if (found || ++tries > most_tries) break;
      HandleWay way;
      way.hand = hand;
      way.grasp = grasp.pose * Pose{{}, hand.turn};
      way.on_body = inverse(seen.body) * way.grasp;
      if (try_grasp(data, start, seen, one, from, to, way)) found = std::move(way);
    }
  }
  return found;
}

std::optional<HandleWay> HandleReach::again(const Start& start, const Articulation& one,
                                            double from, double to, const HandleWay& before) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  const Seen seen = see(data, start, one, from);
  HandleWay way;
  way.hand = before.hand;
  way.on_body = before.on_body;
  way.grasp = seen.body * before.on_body;
  way.pregrasp = seen.to_base * way.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  RobotValues q = seen.now;
  if (!robot_.ik(way.hand.arm, way.pregrasp, q, Chain::kTracking)) return {};
  if (!go_along(seen, one, from, to, q, way)) return {};
  return way;
}

}  // namespace mjsense
