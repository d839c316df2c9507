// SPDX-License-Identifier: Apache-2.0
#include "mjsense/tasks/opening/reach.h"

#include <algorithm>
#include <cmath>

#include "mjsense/core/mujoco_call.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scenes/robot_floor.h"

namespace mjsense {
namespace {

constexpr int kOfRobot = 1 << 30;  // contact bit of the robot's geoms
constexpr double kBuiltSo =
    0.002;  // m, links closer than this at the initial pose are exempt from checks
constexpr double kUnder = 0.7;  // minimum |z| of the normal of a contact with the ground

}  // namespace

HandleReach::HandleReach(const mjModel* model, const Robot& robot, HandleReachCfg cfg)
    : own_(call_mujoco(mj_copyModel, nullptr, model), mj_deleteModel),
      robot_(robot),
      cfg_(cfg),
      base_(driving_base(robot)),
      hands_(arms_with_hands(robot, model)),
      of_robot_(model->nbody, 0),
      fixed_(model->nbody, 0),
      of_gripper_(model->nbody, -1),
      scratch_(own_.get()) {
  for (int b = 1; b < model->nbody; ++b) {
    of_robot_[b] = name_of(model, mjOBJ_BODY, b).starts_with(robot.prefix());
    // A body without a name belongs to the robot if its parent does.
    if (!of_robot_[b] && name_of(model, mjOBJ_BODY, b).empty())
      of_robot_[b] = of_robot_[model->body_parentid[b]];
    for (const ArmAndHand& hand : hands_) {
      if (is_below(model, b, robot.groups()[hand.gripper].root_body)) of_gripper_[b] = hand.gripper;
    }
  }
  const bool floats = std::ranges::any_of(hands_, &ArmAndHand::floats);
  for (int b = 1; b < model->nbody; ++b) {
    const bool stands = !floats && b == robot.base_body();
    fixed_[b] = of_robot_[b] && (model->body_weldid[b] == 0 || stands);
  }
  for (int g = 0; g < model->ngeom; ++g) {
    if (!of_robot_[model->geom_bodyid[g]]) continue;
    const int body = model->geom_bodyid[g];
    own_->geom_margin[g] = base_ >= 0 && fixed_[body] ? cfg_.room : cfg_.clearance;
    // The broad phase uses these margins.
    own_->body_margin[body] =
        std::max(own_->body_margin[body], own_->geom_margin[g] + model->geom_gap[g]);
    if (!model->geom_contype[g] && !model->geom_conaffinity[g]) continue;
    // Here the robot's links collide with each other even if they do not in the simulation.
    own_->geom_contype[g] |= kOfRobot;
    own_->geom_conaffinity[g] |= kOfRobot;
    own_->body_contype[body] |= kOfRobot;
    own_->body_conaffinity[body] |= kOfRobot;
  }
  // Pairs of links in contact at the initial pose are exempt from collision checks.
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const auto& init = robot.cfg().groups[g].init;
    for (std::size_t i = 0; i < init.size(); ++i) data->qpos[robot.groups()[g].qpos[i]] = init[i];
  }
  mj_kinematics(own_.get(), data);
  mj_collision(own_.get(), data);
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.geom[0] < 0 || contact.geom[1] < 0 || contact.dist > kBuiltSo) continue;
    if (of_robot_[model->geom_bodyid[contact.geom[0]]] &&
        of_robot_[model->geom_bodyid[contact.geom[1]]])
      built_so_.emplace_back(contact.geom[0], contact.geom[1]);
  }
}

mjModel HandleReach::with_margins(const mjModel& model) const {
  mjModel mine = model;
  mine.geom_margin = own_->geom_margin;
  mine.geom_contype = own_->geom_contype;
  mine.geom_conaffinity = own_->geom_conaffinity;
  mine.body_margin = own_->body_margin;
  mine.body_contype = own_->body_contype;
  mine.body_conaffinity = own_->body_conaffinity;
  return mine;
}

HandleReach::Start HandleReach::start_of(const World& world) const {
  return start_of(*world.model, state_row(world.data));
}

HandleReach::Start HandleReach::start_of(const mjModel& model, const StateRow& state) const {
  Start start{with_margins(model), {state.qpos, state.qpos + model.nq}, {}, {}};
  if (model.nmocap > 0) {
    start.mocap_pos.assign(state.mocap_pos, state.mocap_pos + 3 * model.nmocap);
    start.mocap_quat.assign(state.mocap_quat, state.mocap_quat + 4 * model.nmocap);
  }
  return start;
}

void HandleReach::show(mjData* data, const RobotValues& values) const {
  const auto set = [&](int group) {
    const auto& qpos = robot_.groups()[group].qpos;
    for (std::size_t i = 0; i < qpos.size(); ++i) data->qpos[qpos[i]] = values[group].values[i];
  };
  for (const ArmAndHand& hand : hands_) set(hand.arm);
  if (base_ >= 0) set(base_);
}

// True if everything else is at least `clearance` away from the robot. `hand` may touch the `held`
// articulation. A driving base may touch only the ground.
bool HandleReach::free(mjData* data, const Start& start, double clearance, const Articulation* held,
                       const ArmAndHand* hand, bool driving) const {
  const mjModel* m = &start.model;
  mj_kinematics(m, data);
  mj_collision(m, data);
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.exclude || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    int mine = m->geom_bodyid[contact.geom[0]], other = m->geom_bodyid[contact.geom[1]];
    if (of_robot_[mine] && of_robot_[other]) {
      if (contact.dist > 0 || (of_gripper_[mine] >= 0 && of_gripper_[mine] == of_gripper_[other]))
        continue;
      const std::pair pair(contact.geom[0], contact.geom[1]);
      if (std::ranges::find(built_so_, pair) == built_so_.end()) return false;
    }
    if (of_robot_[mine] == of_robot_[other]) continue;
    if (!of_robot_[mine]) std::swap(mine, other);
    const bool beside = driving && fixed_[mine] && std::abs(contact.frame[2]) < kUnder;
    if (beside) return false;
    // The ground touches the base, so bodies fixed to the base have a smaller clearance.
    if (contact.dist > (fixed_[mine] ? cfg_.contact : clearance)) continue;
    if (held && of_gripper_[mine] == hand->gripper && is_below(m, other, held->body)) continue;
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
  return free(data, start, cfg_.clearance, nullptr, nullptr);
}

Pose HandleReach::body_pose(const Start& start, const Articulation& one, double q) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  set(data, start, one, q);
  mj_kinematics(&start.model, data);
  return {vec3(data->xpos + 3 * one.body), quat(data->xquat + 4 * one.body)};
}

// Whether the arm can move in a straight line in joint space from each configuration to the next.
bool HandleReach::way_is_free(mjData* data, const Start& start, int arm,
                              std::span<const RobotValues> way) const {
  const std::size_t n = robot_.groups()[arm].qpos.size();
  for (std::size_t k = way.size() - 1; k > 0;
       --k) {  // start at the end, which is most likely blocked
    const auto &a = way[k - 1][arm].values, &b = way[k][arm].values;
    double most = 0;
    for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(b[i] - a[i]));
    const int steps = std::max(2, static_cast<int>(std::ceil(most / cfg_.step)));
    for (int s = steps; s > 0; --s) {
      RobotValues between = way[k];
      for (std::size_t i = 0; i < n; ++i)
        between[arm].values[i] = std::lerp(a[i], b[i], static_cast<double>(s) / steps);
      show(data, between);
      if (!free(data, start, cfg_.clearance, nullptr, nullptr)) return false;
    }
  }
  return true;
}

// Quantities computed once per start and used for all grasps.
struct HandleReach::Seen {
  RobotValues now;
  Pose to_base;  // X_BW
  Pose body;     // X_WB of the handle's body
  Vec3 axis, anchor;
  BasePose base;  // of a driving base
  double z = 0;   // m, height of its frame
};

HandleReach::Seen HandleReach::see(mjData* data, const Start& start, const Articulation& one,
                                   double q) const {
  set(data, start, one, q);
  mj_kinematics(&start.model, data);
  const World world{.id = 0, .model = &start.model, .data = data};
  Seen seen;
  robot_.read_qpos(world, seen.now);
  seen.to_base = inverse(robot_.base_pose(world));
  seen.body = {vec3(data->xpos + 3 * one.body), quat(data->xquat + 4 * one.body)};
  seen.axis = vec3(data->xaxis + 3 * one.joint);
  seen.anchor = vec3(data->xanchor + 3 * one.joint);
  if (base_ >= 0) {
    const auto& at = seen.now[base_].values;
    seen.base = {at[0], at[1], at[2]};
    seen.z = robot_.base_pose(world).p.z;
  }
  return seen;
}

void HandleReach::set(mjData* data, const Start& start, const Articulation& one, double q) const {
  std::ranges::copy(start.qpos, data->qpos);
  std::ranges::copy(start.mocap_pos, data->mocap_pos);
  std::ranges::copy(start.mocap_quat, data->mocap_quat);
  data->qpos[one.qpos] = q;
}

// Computes the positions of arm and base while the handle is held, starting at `q`.
bool HandleReach::go_along(const Seen& seen, const HandleMotion& motion, RobotValues q,
                           HandleWay& way) const {
  const int points = way.drive ? cfg_.drive_points : cfg_.points, arm = way.hand.arm;
  way.along.clear();
  for (int k = 0; k < points; ++k) {
    const double part = static_cast<double>(k) / (points - 1);
    Pose to_base = seen.to_base;
    if (way.drive) {
      const BasePose at = driven(seen.base, *way.drive, motion, way.grasp.p, part);
      to_base = inverse(Pose{{at.x, at.y, seen.z}, axis_angle({0, 0, 1}, at.yaw)});
      const double place[] = {at.x, at.y, at.yaw};
      q[base_].set(place);
    }
    const RobotValues last = q;
    if (!robot_.ik(arm, to_base * motion.at(part) * way.grasp, q, Chain::kTracking)) return false;
    // Joints are interpolated linearly between points. After a large jump, the gripper would leave
    // the handle in between.
    for (int i = 0; k > 0 && i < q[arm].size; ++i) {
      if (std::abs(q[arm].values[i] - last[arm].values[i]) > cfg_.jump) return false;
    }
    way.along.push_back(q);
  }
  return true;
}

bool HandleReach::along_is_free(mjData* data, const Start& start, const HandleMotion& motion,
                                const HandleWay& way) const {
  for (std::size_t k = 0; k < way.along.size(); ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(way.along.size() - 1);
    set(data, start, *motion.one, std::lerp(motion.from, motion.to, part));
    show(data, way.along[k]);
    if (!free(data, start, cfg_.contact, motion.one, &way.hand, way.drive.has_value()))
      return false;
  }
  return true;
}

// Tries to hold the handle with a driving base. The arm's pose at the end is checked first, because
// this check is cheap.
bool HandleReach::try_drives(mjData* data, const Start& start, const Seen& seen,
                             const HandleMotion& motion, const RobotValues& before,
                             HandleWay& way) const {
  RobotValues taken = before;
  const int arm = way.hand.arm;
  if (!robot_.ik(arm, seen.to_base * way.grasp, taken, Chain::kTracking)) return false;
  set(data, start, *motion.one, motion.from);
  show(data, taken);
  if (!free(data, start, cfg_.contact, motion.one, &way.hand)) return false;
  const Pose last = motion.at(1) * way.grasp;
  for (const Drive& drive : mjsense::drives()) {
    const BasePose end = driven(seen.base, drive, motion, way.grasp.p, 1);
    RobotValues q = taken;
    const Pose base{{end.x, end.y, seen.z}, axis_angle({0, 0, 1}, end.yaw)};
    if (!robot_.ik(arm, inverse(base) * last, q, Chain::kTracking)) continue;
    way.drive = drive;
    if (go_along(seen, motion, before, way) && along_is_free(data, start, motion, way)) return true;
  }
  return false;
}

// Finds a path to the pregrasp: a straight one, or one through a via point behind the pregrasp.
bool HandleReach::way_there(mjData* data, const Start& start, const Seen& seen,
                            const RobotValues& before, HandleWay& way) const {
  const int arm = way.hand.arm;
  way.go = {seen.now, before};
  bool ok = way_is_free(data, start, arm, way.go);
  for (std::size_t k = 0; k < cfg_.detours.size() && !ok; ++k) {
    RobotValues by = before;
    const Pose back = way.pregrasp * Pose{{0, 0, -cfg_.detours[k]}, {}};
    if (!robot_.ik(arm, back, by, Chain::kTracking)) continue;
    way.go = {seen.now, by, before};
    ok = way_is_free(data, start, arm, way.go);
  }
  return ok;
}

bool HandleReach::try_grasp(mjData* data, const Start& start, const Seen& seen,
                            const HandleMotion& motion, bool driving, HandleWay& way) const {
  const int arm = way.hand.arm;
  way.pregrasp = seen.to_base * way.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  // Inverse kinematics starts from the initial posture without noise, so that noise does not change
  // the solution.
  RobotValues before = seen.now;
  before[arm].set(robot_.cfg().groups[arm].init);
  if (before[arm].size != seen.now[arm].size) before[arm] = seen.now[arm];
  if (!robot_.ik(arm, way.pregrasp, before, 2 * Chain::kTracking)) return false;
  // The pregrasp is reachable. Check the motion with the handle for collisions.
  if (driving ? !try_drives(data, start, seen, motion, before, way)
              : !go_along(seen, motion, before, way) || !along_is_free(data, start, motion, way))
    return false;
  set(data, start, *motion.one, motion.from);
  return way_there(data, start, seen, before, way);
}

std::optional<HandleWay> HandleReach::find(const Start& start, const Articulation& one, double from,
                                           double to, int most_tries, bool driving) const {
  const ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  const Seen seen = see(data, start, one, from);
  const HandleMotion motion{&one, from, to, seen.axis, seen.anchor};
  std::optional<HandleWay> found;
  if (driving && base_ < 0) return found;
  for (const ArmAndHand& hand : hands_) {
    int tries = 0;
    const double opening = robot_.groups()[hand.gripper].max_opening;
    for (const HandleGrasp& grasp : propose_handle_grasps(one.handle, seen.body, opening)) {
      if (found || ++tries > most_tries) break;
      HandleWay way;
      way.hand = hand;
      way.grasp = grasp.pose * Pose{{}, hand.turn};
      way.on_body = inverse(seen.body) * way.grasp;
      way.end = motion.at(1) * way.grasp;
      if (hand.floats()) {
        if (try_floating(data, start, inverse(seen.to_base), motion, way)) found = std::move(way);
      } else if (try_grasp(data, start, seen, motion, driving, way))
        found = std::move(way);
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
  way.drive = before.drive;
  way.on_body = before.on_body;
  way.grasp = seen.body * before.on_body;
  const HandleMotion motion{&one, from, to, seen.axis, seen.anchor};
  way.end = motion.at(1) * way.grasp;
  if (way.hand.floats()) return way;
  way.pregrasp = seen.to_base * way.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  RobotValues q = seen.now;
  if (!robot_.ik(way.hand.arm, way.pregrasp, q, Chain::kTracking)) return {};
  if (!go_along(seen, motion, q, way)) return {};
  return way;
}

}  // namespace mjsense
