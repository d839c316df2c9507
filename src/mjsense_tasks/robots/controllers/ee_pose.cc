// SPDX-License-Identifier: Apache-2.0
// Controllers `ee_pose` and `ee_delta_pose`: commands are poses or displacements of the tool. At
// each command, damped inverse kinematics finds joint positions near the last targets, which the
// position servos reach along a linear ramp over the policy step. Redundant joints move as little
// as possible. Joints of other groups between base and tool (a torso) keep their measured
// positions.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"
#include "mjsense_tasks/robots/controllers/pose_target.h"
#include "mjsense_tasks/robots/controllers/ramp.h"
#include "mjsense_tasks/robots/kinematics.h"

namespace mjsense::tasks::robots {
namespace {

// Steps of the inverse kinematics of one command, and the error at which it ends, m and rad. A
// displacement of 5 cm and 0.25 rad needs 3 to 5.
constexpr int kIterations = 20;
constexpr double kTolerance = 1e-6;

Chain chain_to_tool(const MoveGroup& group, const ControllerInit& init, const char* kind) {
  if (group.leaf_site < 0)
    throw ValueError(fmt::format("{}: the controller '{}' needs leaf_site, the site of the tool",
                                 init.context, kind));
  std::vector<int> all(init.model->njnt);
  std::iota(all.begin(), all.end(), 0);
  return Chain(init.model, init.base_body, group.leaf_site, all);
}

// The pose on the way from `from` to `to` that is at most `distance` (m) and `angle` (rad) away.
// Translation and rotation have the same share.
Pose limited(const Pose& from, const Pose& to, double distance, double angle) {
  const Vec3 offset = to.p - from.p, turn = log3(conjugate(from.q) * to.q);
  const double excess = std::max(norm(offset) / distance, norm(turn) / angle);
  if (excess <= 1) return to;
  return {from.p + (1 / excess) * offset, normalized(from.q * exp3((1 / excess) * turn))};
}

class ToolController : public RampedController {
 public:
  ToolController(const char* kind, double max_joint_speed, const MoveGroup& group,
                 const ControllerInit& init)
      : RampedController(true, group, init),
        chain_(chain_to_tool(group, init, kind)),
        max_motion_(max_joint_speed * init.periods.policy_dt) {
    need_position_servos(init, kind);
    const std::size_t n = chain_.joints().size();
    low_.assign(chain_.low().begin(), chain_.low().end());
    high_.assign(chain_.high().begin(), chain_.high().end());
    for (std::size_t k = 0; k < n; ++k) {
      const int joint = chain_.joints()[k];
      address_.push_back(model_->jnt_qposadr[joint]);
      const auto at = std::ranges::find_if(
          group_.actuators, [&](int a) { return model_->actuator_trnid[2 * a] == joint; });
      const int i =
          at == group_.actuators.end() ? -1 : static_cast<int>(at - group_.actuators.begin());
      actuator_.push_back(i);
      moves_[k] = i >= 0;
      if (i < 0) continue;
      low_[k] = std::max(low_[k], group_.ctrl_low[i]);
      high_[k] = std::min(high_[k], group_.ctrl_high[i]);
    }
    for (int i = 0; i < size(); ++i) {
      if (std::ranges::find(actuator_, i) != actuator_.end()) continue;
      throw ValueError(fmt::format(
          "{}: the controller '{}' moves the tool '{}', but the actuator '{}' drives no joint "
          "between it and the base",
          init.context, kind, mj_id2name(model_, mjOBJ_SITE, group_.leaf_site),
          mj_id2name(model_, mjOBJ_ACTUATOR, group_.actuators[i])));
    }
  }

 protected:
  using Positions = std::array<double, Chain::kMaxJoints>;

  // Positions of the chain's joints: `target` for those of the group, measured ones for the others.
  Positions joints_at(const World& world, std::span<const double> target) const {
    Positions q{};
    for (std::size_t k = 0; k < address_.size(); ++k)
      q[k] = actuator_[k] >= 0 ? target[actuator_[k]] : world.data->qpos[address_[k]];
    return q;
  }
  Positions measured(const World& world) const {
    Positions q{};
    for (std::size_t k = 0; k < address_.size(); ++k) q[k] = world.data->qpos[address_[k]];
    return q;
  }
  Pose fk(const Positions& q) const { return chain_.fk({q.data(), address_.size()}); }

  // Moves `target` from its present value such that the tool is at `goal` (base frame) or as close
  // as the limits allow.
  void move_to(const World& world, const Pose& goal, std::span<double> target) const {
    const std::size_t n = address_.size();
    const Positions start = joints_at(world, target);
    Positions q = start, dq;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Pose tool = fk(q);
      const Twist error{goal.p - tool.p, rotate(tool.q, log3(conjugate(tool.q) * goal.q))};
      if (norm(error) < kTolerance) break;
      chain_.joint_motion({q.data(), n}, error, {dq.data(), n}, {moves_.data(), n});
      for (std::size_t k = 0; k < n; ++k)
        if (moves_[k]) q[k] = std::clamp(q[k] + dq[k], low_[k], high_[k]);
    }
    double motion = max_motion_;
    for (std::size_t k = 0; k < n; ++k) motion = std::max(motion, std::abs(q[k] - start[k]));
    const double share = max_motion_ / motion;
    for (std::size_t k = 0; k < n; ++k)
      if (moves_[k]) target[actuator_[k]] = start[k] + share * (q[k] - start[k]);
  }

  const Chain chain_;

 private:
  double max_motion_;                    // of a joint's target in one policy step, rad or m
  std::vector<int> address_, actuator_;  // of each joint of the chain; -1: not of this group
  std::vector<double> low_, high_;       // limits of the targets
  std::array<bool, Chain::kMaxJoints> moves_{};
};

class EePose final : public ToolController {
 public:
  EePose(const EePoseCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : ToolController("ee_pose", cfg.max_joint_speed, group, init),
        context_(init.context),
        max_distance_(cfg.max_speed * init.periods.policy_dt),
        max_angle_(cfg.max_turn * init.periods.policy_dt) {}

  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_size = 7;
    group.command_unit = "m, wxyz";
    group.command_low = {-mjMAXVAL, -mjMAXVAL, -mjMAXVAL, -1, -1, -1, -1};
    group.command_high = {mjMAXVAL, mjMAXVAL, mjMAXVAL, 1, 1, 1, 1};
  }
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override {
    write_pose(fk(joints_at(world, target)), command.data());
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override {
    const Pose goal = commanded_pose(command, context_);
    const Pose last = fk(joints_at(world, target));
    move_to(world, limited(last, goal, max_distance_, max_angle_), target);
  }

 private:
  std::string context_;
  double max_distance_, max_angle_;  // of one policy step, m and rad
};

class EeDeltaPose final : public ToolController {
 public:
  EeDeltaPose(const EeDeltaPoseCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : ToolController("ee_delta_pose", cfg.max_joint_speed, group, init),
        cfg_(cfg),
        goals_(init.num_worlds) {}

  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_size = 6;
    group.command_unit = "m, m, m, rad, rad, rad";
    const double x = cfg_.max_translation, r = cfg_.max_rotation;
    group.command_low = {-x, -x, -x, -r, -r, -r};
    group.command_high = {x, x, x, r, r, r};
  }
  void hold(const World& world, std::span<double> target) override {
    ActuatedController::hold(world, target);
    goals_[world.id].reset();
  }
  void keep(const World& /*world*/, std::span<const double> /*target*/,
            std::span<double> command) const override {
    std::ranges::fill(command, 0.0);
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override {
    std::array<double, 6> d;
    for (int i = 0; i < 6; ++i) {
      const double limit = i < 3 ? cfg_.max_translation : cfg_.max_rotation;
      d[i] = std::clamp(command[i], -limit, limit);
    }
    const Vec3 offset{d[0], d[1], d[2]};
    const Quat turn = exp3({d[3], d[4], d[5]});
    const Pose targeted = fk(joints_at(world, target));
    std::optional<Pose>& goal = goals_[world.id];
    const Pose last =
        cfg_.reference == DeltaReference::kMeasured ? fk(measured(world)) : goal.value_or(targeted);
    goal = cfg_.frame == DeltaFrame::kTool ? last * Pose{offset, turn}
                                           : Pose{last.p + offset, normalized(turn * last.q)};
    goal = limited(targeted, *goal, kLead * cfg_.max_translation, kLead * cfg_.max_rotation);
    move_to(world, *goal, target);
  }

 private:
  // How far, in commands, the goal may be ahead of the targets of the servos, which are slower near
  // singular postures and stop at limits.
  static constexpr double kLead = 2;
  EeDeltaPoseCfg cfg_;
  std::vector<std::optional<Pose>> goals_;  // [B]: sum of the displacements; empty after a hold
};

}  // namespace

std::unique_ptr<Controller> make_kind(const EePoseCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<EePose>(cfg, group, init);
}

std::unique_ptr<Controller> make_kind(const EeDeltaPoseCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  return std::make_unique<EeDeltaPose>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
