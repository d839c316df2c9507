// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/handle_reach.h"

#include <algorithm>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/start_positions.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks {
namespace {

constexpr int kOfRobot = 1 << 30;  // contact bit of the robot's geoms
// m, links closer than this at the initial pose are exempt from checks
constexpr double kTouching = 0.002;
constexpr double kUnder = 0.7;  // minimum |z| of the normal of a contact with the ground

void write_start(mjData* data, const HandleReach::Start& start) {
  std::ranges::copy(start.qpos, data->qpos);
  std::ranges::copy(start.mocap_pos, data->mocap_pos);
  std::ranges::copy(start.mocap_quat, data->mocap_quat);
}

}  // namespace

HandleReach::HandleReach(const mjModel* model, const robots::Robot& robot, HandleReachCfg cfg)
    : own_(call_mujoco(mj_copyModel, nullptr, model)),
      robot_(robot),
      cfg_(cfg),
      base_(scenes::driving_base(robot)),
      hands_(oriented_hands(robot, model)),
      of_robot_(model->nbody, 0),
      fixed_(model->nbody, 0),
      of_gripper_(model->nbody, -1),
      scratch_(own_.get()) {
  for (int b = 1; b < model->nbody; ++b) {
    of_robot_[b] = scene::name_of(model, mjOBJ_BODY, b).starts_with(robot.prefix());
    // A body without a name belongs to the robot if its parent does.
    if (!of_robot_[b] && scene::name_of(model, mjOBJ_BODY, b).empty())
      of_robot_[b] = of_robot_[model->body_parentid[b]];
    for (const OrientedHand& hand : hands_) {
      if (observe::is_descendant_or_self(model, b, robot.groups()[hand.gripper].root_body))
        of_gripper_[b] = hand.gripper;
    }
  }
  const bool floats = std::ranges::any_of(hands_, &OrientedHand::floats);
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
    if (!is_solid(model, g)) continue;
    // Here the robot's links collide with each other even if they do not in the simulation.
    own_->geom_contype[g] |= kOfRobot;
    own_->geom_conaffinity[g] |= kOfRobot;
    own_->body_contype[body] |= kOfRobot;
    own_->body_conaffinity[body] |= kOfRobot;
  }
  // Pairs of links in contact at the initial pose are exempt from collision checks.
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  robots::write_start_positions(robot, data->qpos);
  mj_kinematics(own_.get(), data);
  mj_collision(own_.get(), data);
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.geom[0] < 0 || contact.geom[1] < 0 || contact.dist > kTouching) continue;
    if (of_robot_[model->geom_bodyid[contact.geom[0]]] &&
        of_robot_[model->geom_bodyid[contact.geom[1]]])
      initial_contacts_.emplace_back(contact.geom[0], contact.geom[1]);
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
  return start_of(*world.model, robots::state_row(world.data));
}

HandleReach::Start HandleReach::start_of(const mjModel& model,
                                         const robots::StateRow& state) const {
  Start start{with_margins(model), {state.qpos, state.qpos + model.nq}, {}, {}};
  if (model.nmocap > 0) {
    start.mocap_pos.assign(state.mocap_pos, state.mocap_pos + 3 * model.nmocap);
    start.mocap_quat.assign(state.mocap_quat, state.mocap_quat + 4 * model.nmocap);
  }
  return start;
}

void HandleReach::write_joints(mjData* data, const robots::RobotValues& values) const {
  const auto set = [&](int group) {
    const auto& qpos = robot_.groups()[group].qpos;
    for (std::size_t i = 0; i < qpos.size(); ++i) data->qpos[qpos[i]] = values[group].values[i];
  };
  for (const OrientedHand& hand : hands_) set(hand.tool);
  if (base_ >= 0) set(base_);
}

robots::AllowedContact HandleReach::grasp_of(const OrientedHand& hand,
                                             const Articulation& one) const {
  return {robot_.groups()[hand.gripper].root_body, one.body};
}

// True if everything else is at least `clearance` away from the robot, except for the `allowed`
// contact. A driving base may touch only the ground.
bool HandleReach::free(mjData* data, const Start& start, double clearance,
                       const robots::AllowedContact& allowed, bool driving) const {
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
      if (std::ranges::find(initial_contacts_, pair) == initial_contacts_.end()) return false;
    }
    if (of_robot_[mine] == of_robot_[other]) continue;
    if (!of_robot_[mine]) std::swap(mine, other);
    const bool beside = driving && fixed_[mine] && std::abs(contact.frame[2]) < kUnder;
    if (beside) return false;
    // The ground touches the base, so bodies fixed to the base have a smaller clearance.
    if (contact.dist > (fixed_[mine] ? cfg_.contact : clearance)) continue;
    if (!allowed.permits(m, mine, other)) return false;
  }
  return true;
}

bool HandleReach::is_collision_free(const Start& start) const {
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  write_start(data, start);
  return free(data, start, cfg_.clearance);
}

Pose HandleReach::body_pose(const Start& start, const Articulation& one, double q) const {
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  write_state(data, start, one, q);
  mj_kinematics(&start.model, data);
  return mjsense::body_pose(data, one.body);
}

// Whether the arm can move in a straight line in joint space from each configuration to the next.
bool HandleReach::path_is_free(mjData* data, const Start& start, int arm,
                               std::span<const robots::RobotValues> path) const {
  const std::size_t n = robot_.groups()[arm].qpos.size();
  for (std::size_t k = path.size() - 1; k > 0;
       --k) {  // start at the end, which is most likely blocked
    const auto &a = path[k - 1][arm].values, &b = path[k][arm].values;
    double maximum = 0;
    for (std::size_t i = 0; i < n; ++i) maximum = std::max(maximum, std::abs(b[i] - a[i]));
    const int steps = std::max(2, static_cast<int>(std::ceil(maximum / cfg_.step)));
    for (int s = steps; s > 0; --s) {
      robots::RobotValues between = path[k];
      for (std::size_t i = 0; i < n; ++i)
        between[arm].values[i] = std::lerp(a[i], b[i], static_cast<double>(s) / steps);
      write_joints(data, between);
      if (!free(data, start, cfg_.clearance)) return false;
    }
  }
  return true;
}

// Quantities computed once per start and used for all grasps.
struct HandleReach::Geometry {
  robots::RobotValues now;
  Pose to_base;  // X_BW
  Pose body;     // X_WB of the handle's body
  Vec3 axis, anchor;
  scenes::BasePose base;  // of a driving base
  double z = 0;           // m, height of its frame
};

HandleReach::Geometry HandleReach::measure(mjData* data, const Start& start,
                                           const Articulation& one, double q) const {
  write_state(data, start, one, q);
  mj_kinematics(&start.model, data);
  const World world{.id = 0, .model = &start.model, .data = data};
  Geometry at_start;
  robot_.read_qpos(world, at_start.now);
  at_start.to_base = inverse(robot_.base_pose(world));
  at_start.body = mjsense::body_pose(data, one.body);
  at_start.axis = vec3(data->xaxis + 3 * one.joint);
  at_start.anchor = vec3(data->xanchor + 3 * one.joint);
  if (base_ >= 0) {
    const auto& at = at_start.now[base_].values;
    at_start.base = {at[0], at[1], at[2]};
    at_start.z = robot_.base_pose(world).p.z;
  }
  return at_start;
}

void HandleReach::write_state(mjData* data, const Start& start, const Articulation& one,
                              double q) const {
  write_start(data, start);
  data->qpos[one.qpos] = q;
}

// Computes the positions of arm and base while the handle is held, starting at `q`.
bool HandleReach::follow_handle(const Geometry& at_start, const HandleMotion& motion,
                                robots::RobotValues q, HandlePath& path) const {
  const int points = path.drive ? cfg_.drive_points : cfg_.points, arm = path.hand.tool;
  path.motion_joints.clear();
  for (int k = 0; k < points; ++k) {
    const double part = static_cast<double>(k) / (points - 1);
    Pose to_base = at_start.to_base;
    if (path.drive) {
      const scenes::BasePose at = driven(at_start.base, *path.drive, motion, path.grasp.p, part);
      to_base = inverse(at.at_height(at_start.z));
      const double place[] = {at.x, at.y, at.yaw};
      q[base_].set(place);
    }
    const robots::RobotValues last = q;
    if (!robot_.ik(arm, to_base * motion.at(part) * path.grasp, q, robots::Chain::kTracking))
      return false;
    // Joints are interpolated linearly between points. After a large jump, the gripper would leave
    // the handle in between.
    for (int i = 0; k > 0 && i < q[arm].size; ++i) {
      if (std::abs(q[arm].values[i] - last[arm].values[i]) > cfg_.jump) return false;
    }
    path.motion_joints.push_back(q);
  }
  return true;
}

bool HandleReach::motion_is_free(mjData* data, const Start& start, const HandleMotion& motion,
                                 const HandlePath& path) const {
  for (std::size_t k = 0; k < path.motion_joints.size(); ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(path.motion_joints.size() - 1);
    write_state(data, start, *motion.one, std::lerp(motion.from, motion.to, part));
    write_joints(data, path.motion_joints[k]);
    if (!free(data, start, cfg_.contact, grasp_of(path.hand, *motion.one), path.drive.has_value()))
      return false;
  }
  return true;
}

// Tries to hold the handle with a driving base. The arm's pose at the end is checked first, because
// this check is cheap.
bool HandleReach::try_drives(mjData* data, const Start& start, const Geometry& at_start,
                             const HandleMotion& motion, const robots::RobotValues& before,
                             HandlePath& path) const {
  robots::RobotValues taken = before;
  const int arm = path.hand.tool;
  if (!robot_.ik(arm, at_start.to_base * path.grasp, taken, robots::Chain::kTracking)) return false;
  write_state(data, start, *motion.one, motion.from);
  write_joints(data, taken);
  if (!free(data, start, cfg_.contact, grasp_of(path.hand, *motion.one))) return false;
  const Pose last = motion.at(1) * path.grasp;
  for (const Drive& drive : tasks::drives()) {
    const scenes::BasePose end = driven(at_start.base, drive, motion, path.grasp.p, 1);
    robots::RobotValues q = taken;
    if (!robot_.ik(arm, inverse(end.at_height(at_start.z)) * last, q, robots::Chain::kTracking))
      continue;
    path.drive = drive;
    if (follow_handle(at_start, motion, before, path) && motion_is_free(data, start, motion, path))
      return true;
  }
  return false;
}

// Finds a path to the pregrasp: a straight one, or one through a via point behind the pregrasp.
bool HandleReach::approach_path(mjData* data, const Start& start, const Geometry& at_start,
                                const robots::RobotValues& before, HandlePath& path) const {
  const int arm = path.hand.tool;
  path.approach_joints = {at_start.now, before};
  bool ok = path_is_free(data, start, arm, path.approach_joints);
  for (std::size_t k = 0; k < cfg_.detours.size() && !ok; ++k) {
    robots::RobotValues by = before;
    const Pose back = path.pregrasp * Pose{{0, 0, -cfg_.detours[k]}, {}};
    if (!robot_.ik(arm, back, by, robots::Chain::kTracking)) continue;
    path.approach_joints = {at_start.now, by, before};
    ok = path_is_free(data, start, arm, path.approach_joints);
  }
  return ok;
}

bool HandleReach::try_grasp(mjData* data, const Start& start, const Geometry& at_start,
                            const HandleMotion& motion, bool driving, HandlePath& path) const {
  const int arm = path.hand.tool;
  path.pregrasp = at_start.to_base * path.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  // Inverse kinematics starts from the initial posture without noise, so that noise does not change
  // the solution.
  robots::RobotValues before = at_start.now;
  before[arm].set(robot_.cfg().groups[arm].init);
  if (before[arm].size != at_start.now[arm].size) before[arm] = at_start.now[arm];
  if (!robot_.ik(arm, path.pregrasp, before, 2 * robots::Chain::kTracking)) return false;
  // The pregrasp is reachable. Check the motion with the handle for collisions.
  if (driving ? !try_drives(data, start, at_start, motion, before, path)
              : !follow_handle(at_start, motion, before, path) ||
                    !motion_is_free(data, start, motion, path))
    return false;
  write_state(data, start, *motion.one, motion.from);
  return approach_path(data, start, at_start, before, path);
}

std::optional<HandlePath> HandleReach::find(const Start& start, const Articulation& one,
                                            double from, double to, int max_tries,
                                            bool driving) const {
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  const Geometry at_start = measure(data, start, one, from);
  const HandleMotion motion{&one, from, to, at_start.axis, at_start.anchor};
  std::optional<HandlePath> found;
  if (driving && base_ < 0) return found;
  for (const OrientedHand& hand : hands_) {
    int tries = 0;
    const double opening = robot_.groups()[hand.gripper].max_opening;
    for (const HandleGrasp& grasp : propose_handle_grasps(one.handle, at_start.body, opening)) {
      if (found || ++tries > max_tries) break;
      HandlePath path;
      path.hand = hand;
      path.grasp = grasp.pose * Pose{{}, hand.turn};
      path.on_body = inverse(at_start.body) * path.grasp;
      path.end = motion.at(1) * path.grasp;
      if (hand.floats()) {
        if (try_floating(data, start, inverse(at_start.to_base), motion, path))
          found = std::move(path);
      } else if (try_grasp(data, start, at_start, motion, driving, path))
        found = std::move(path);
    }
  }
  return found;
}

std::optional<HandlePath> HandleReach::again(const Start& start, const Articulation& one,
                                             double from, double to,
                                             const HandlePath& before) const {
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* data = loan.get();
  const Geometry at_start = measure(data, start, one, from);
  HandlePath path;
  path.hand = before.hand;
  path.drive = before.drive;
  path.on_body = before.on_body;
  path.grasp = at_start.body * before.on_body;
  const HandleMotion motion{&one, from, to, at_start.axis, at_start.anchor};
  path.end = motion.at(1) * path.grasp;
  if (path.hand.floats()) return path;
  path.pregrasp = at_start.to_base * path.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  robots::RobotValues q = at_start.now;
  if (!robot_.ik(path.hand.tool, path.pregrasp, q, robots::Chain::kTracking)) return {};
  if (!follow_handle(at_start, motion, q, path)) return {};
  return path;
}

}  // namespace mjsense::tasks
