// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/pick_planner.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

// Numbers that readers of recordings know; not all occur in a pick.
constexpr Phase kPhases[] = {
    {"unknown", 0}, {"gripper-open", 1}, {"pregrasp", 2}, {"grasp", 3},   {"gripper-close", 4},
    {"lift", 5},    {"preplace", 6},     {"place", 7},    {"retreat", 8}, {"go_home", 9}};
enum PhaseNumber { kUnknown = 0, kOpen = 1, kPregrasp = 2, kGrasp = 3, kClose = 4, kLift = 5 };

// m, gripper to all objects on the way to the pregrasp. The target too: at the end of the fast leg
// the tool is 2 cm behind its command, and fingers already beside a high object would push it over.
constexpr double kPathMargin = 0.008;
constexpr double kGraspMargin = 0.003;  // m, at the grasp
constexpr double kPathStep = 0.01;      // m

Pose raised(Pose pose, double height) {
  pose.p.z += height;
  return pose;
}

Pose object_pose(const World& world, int body) {
  return {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
}

}  // namespace

std::span<const Phase> PickPlanner::phases() const { return kPhases; }

void PickPlanner::initialize(Task& task) {
  task_ = &task;
  scene_ = task.grasp_scene();
  if (!scene_)
    throw ValueError(fmt::format("policy 'planner' picks; it cannot do task '{}'", task.name()));
  const Robot& robot = task_->robot();
  if (robot.arm() < 0 || robot.gripper() < 0)
    throw ValueError(fmt::format(
        "policy 'planner' needs an arm and a gripper; robot '{}' lacks one", robot.name()));
  const auto driven = robot.chain(robot.arm()).joints();
  if (!std::ranges::equal(driven, robot.groups()[robot.arm()].joints))
    throw ValueError(
        fmt::format("policy 'planner' moves the tool by the arm alone; that of robot '{}' moves "
                    "with others too",
                    robot.name()));
  gripper_shape_ = std::make_unique<GripperShape>(task_->model(), robot, robot.gripper());
  plans_.assign(task_->num_worlds(), {});
}

void PickPlanner::reset(const World& world) {
  plans_[world.id] = {};
  plan(world, plans_[world.id]);
}

void PickPlanner::read_arm(const World& world, std::span<double> q) const {
  const auto& address = task_->robot().groups()[task_->robot().arm()].qpos;
  for (std::size_t i = 0; i < address.size(); ++i) q[i] = world.data->qpos[address[i]];
}

void PickPlanner::plan(const World& world, Plan& plan) const {
  const Robot& robot = task_->robot();
  const MoveGroup& gripper = robot.groups()[robot.gripper()];
  plan.planned = false;
  plan.finished = false;
  plan.leg = 0;
  plan.leg_start = world.time();
  plan.ik_failures = 0;
  plan.phase = kOpen;
  read_arm(world, plan.q);
  plan.target = robot.tcp_pose(world, robot.arm());
  Grasp grasp;
  if (!choose_grasp(world, grasp)) return;
  plan.planned = true;
  plan.grasp = grasp.pose;

  const Pose to_base = inverse(robot.base_pose(world));
  const Pose start = plan.target, at = to_base * grasp.pose;
  const Pose before = to_base * raised(grasp.pose, cfg_.pregrasp_height);
  const Pose after = to_base * raised(grasp.pose, cfg_.lift_height);
  const auto move = [](int phase, const Pose& from, const Pose& to, double speed, double wait,
                       double command) {
    Leg leg{.phase = phase, .from = from, .screw = log6(inverse(from) * to), .gripper = command};
    leg.move = norm(leg.screw.v) / speed;
    leg.duration = leg.move + wait;
    return leg;
  };
  const double open = gripper.open_command, closed = gripper.closed_command;
  plan.legs[0] = move(kOpen, start, start, cfg_.fast, 0.0, open);
  plan.legs[1] = move(kPregrasp, start, before, cfg_.fast, 0.0, open);
  plan.legs[2] = move(kGrasp, before, at, cfg_.slow, cfg_.settle, open);
  plan.legs[3] = move(kClose, at, at, cfg_.slow, cfg_.close_time, closed);
  plan.legs[4] = move(kLift, at, after, cfg_.slow, 0.0, closed);
}

bool PickPlanner::choose_grasp(const World& world, Grasp& chosen) const {
  const Robot& robot = task_->robot();
  const auto objects = scene_->all_objects();
  const auto& target = objects[scene_->target(world.id)];
  const Pose tool = robot.leaf_pose(world, robot.arm()), base = robot.base_pose(world);
  const std::vector<Grasp> grasps =
      propose_grasps(*gripper_shape_, target.shape, object_pose(world, target.body),
                     scene_->support_height(world.id), tool);
  std::array<double, Chain::kMaxJoints> q;
  read_arm(world, q);
  int tried = 0;
  const Grasp* second_best = nullptr;  // reachable, but something stands in the way
  for (const Grasp& grasp : grasps) {
    bool blocked = false;
    for (const auto& other : objects) {
      if (other.body == target.body) continue;
      blocked = blocked || gripper_shape_->hits(grasp.pose, object_pose(world, other.body),
                                                other.shape, kGraspMargin);
    }
    if (blocked) continue;
    if (++tried > cfg_.max_ik_candidates) break;
    if (!reachable(base, grasp.pose, q)) continue;
    if (path_is_free(world, tool, raised(grasp.pose, cfg_.pregrasp_height))) {
      chosen = grasp;
      return true;
    }
    if (!second_best) second_best = &grasp;
  }
  if (!second_best) return false;
  chosen = *second_best;
  return true;
}

bool PickPlanner::reachable(const Pose& base, const Pose& grasp, std::span<const double> q) const {
  const Chain& chain = task_->robot().chain(task_->robot().arm());
  std::array<double, Chain::kMaxJoints> solution;
  std::copy_n(q.begin(), chain.joints().size(), solution.begin());
  const std::span<double> s(solution.data(), chain.joints().size());
  const Pose to_base = inverse(base);
  // In the order of the motion, each from the one before: what works here works when it is
  // followed.
  return chain.ik(to_base * raised(grasp, cfg_.pregrasp_height), s, Chain::kTracking) &&
         chain.ik(to_base * grasp, s, Chain::kTracking) &&
         chain.ik(to_base * raised(grasp, cfg_.lift_height), s, Chain::kTracking);
}

bool PickPlanner::path_is_free(const World& world, const Pose& tool, const Pose& pregrasp) const {
  const Twist screw = log6(inverse(tool) * pregrasp);
  const int steps = std::max(1, static_cast<int>(norm(screw.v) / kPathStep));
  const auto objects = scene_->all_objects();
  for (int i = 1; i <= steps; ++i) {
    const Pose at = tool * exp6((static_cast<double>(i) / steps) * screw);
    for (const auto& object : objects) {
      if (gripper_shape_->hits(at, object_pose(world, object.body), object.shape, kPathMargin))
        return false;
    }
  }
  return true;
}

bool PickPlanner::failed(const World& world, const Plan& plan) const {
  const Robot& robot = task_->robot();
  const Pose tool = robot.tcp_pose(world, robot.arm());
  if (norm(tool.p - plan.target.p) > cfg_.max_position_error) return true;
  if (angle_between(tool.q, plan.target.q) > cfg_.max_rotation_error) return true;
  if (plan.phase == kLift && robot.opening(world, robot.gripper()) < cfg_.min_held_opening)
    return true;
  return plan.ik_failures >= cfg_.max_ik_failures;
}

void PickPlanner::act(const World& world, Action& action) {
  Plan& plan = plans_[world.id];
  const Robot& robot = task_->robot();
  action = {};
  if (plan.planned && !plan.finished && failed(world, plan)) {
    if (plan.retries < cfg_.max_retries) {
      ++plan.retries;
      this->plan(world, plan);
      if (plan.planned) return;  // hold for this step
    } else {
      plan.planned = false;
    }
  }
  if (!plan.planned) {
    action.done = true;
    action.success = false;
    return;
  }

  while (plan.leg < kLegs && world.time() - plan.leg_start >= plan.legs[plan.leg].duration) {
    plan.leg_start += plan.legs[plan.leg].duration;
    ++plan.leg;
  }
  plan.finished = plan.leg == kLegs;
  const Leg& leg = plan.legs[std::min(plan.leg, kLegs - 1)];
  plan.phase = leg.phase;
  const double s = plan.finished || leg.move == 0
                       ? 1.0
                       : std::min(1.0, (world.time() - plan.leg_start) / leg.move);
  plan.target = leg.from * exp6(s * leg.screw);

  const int arm = robot.arm();
  const std::size_t n = robot.chain(arm).joints().size();
  std::array<double, Chain::kMaxJoints> q = plan.q;
  if (robot.chain(arm).ik(plan.target, {q.data(), n}, Chain::kTracking)) {
    plan.q = q;
    plan.ik_failures = 0;
  } else {
    ++plan.ik_failures;  // the last command stands
  }
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    // One that drives is left out: it holds.
    if (group.kind == GroupKind::kBase && !group.controlled()) action.commands[g].set({});
  }
  action.commands[arm].set({plan.q.data(), n});
  action.commands[robot.gripper()].set({&leg.gripper, 1});
  action.done = plan.finished;
}

}  // namespace mjsense
