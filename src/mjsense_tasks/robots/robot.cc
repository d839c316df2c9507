// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/robot.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/named.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/action_noise.h"

namespace mjsense::tasks::robots {
namespace {

void check_groups(const std::string& context, std::size_t found) {
  if (found > RobotValues::kMaxGroups) {
    throw ValueError(fmt::format("{}: {} move groups: the maximum is {}", context, found,
                                 RobotValues::kMaxGroups));
  }
}

// Throws ValueError unless the tool frame of a gripper has the axes that grasps are planned with: z
// points from the hand to the object, and the pads are apart along y or x.
void check_tool_frame(const RobotCfg& cfg, const MoveGroupCfg& group_cfg, const MoveGroup& group,
                      const mjModel* model, mjData* data) {
  for (std::size_t i = 0; i < group_cfg.init.size(); ++i)
    data->qpos[group.qpos[i]] = group_cfg.init[i];
  mj_kinematics(model, data);
  constexpr double kAlong = 0.9;    // cosine of 26 degrees
  constexpr double kClosed = 1e-3;  // m
  const Pose tool = site_pose(data, group.leaf_site);
  const Vec3 pads[2] = {vec3(data->site_xpos + 3 * group.pad_sites[0]),
                        vec3(data->site_xpos + 3 * group.pad_sites[1])};
  const Vec3 between = pads[1] - pads[0];
  if (norm(between) < kClosed) return;  // closed at the start: the direction is not known
  const Vec3 closing = normalized(between);
  const Vec3 out = 0.5 * (pads[0] + pads[1]) - vec3(data->xpos + 3 * group.root_body);
  const Vec3 forward = out - dot(out, closing) * closing;
  if (norm(forward) < kClosed) return;
  const Vec3 approach = normalized(forward), in_tool = rotate(conjugate(tool.q), closing);
  if (std::max(std::abs(in_tool.x), std::abs(in_tool.y)) > kAlong &&
      dot(rotate(tool.q, {0, 0, 1}), approach) > 0)
    return;
  const int body = model->site_bodyid[group.leaf_site];
  const Quat wanted = quat_from_columns(cross(closing, approach), closing, approach);
  const Quat local = conjugate(quat(data->xquat + 4 * body)) * wanted;
  const Vec3 z = rotate(conjugate(tool.q), approach);
  throw ValueError(fmt::format(
      "{}: move group '{}': leaf_site '{}': its z axis must point from the hand to the object, and "
      "its y or x axis from pad to pad; in its frame, the pads are in direction ({:.2f}, {:.2f}, "
      "{:.2f}) of the hand and apart along ({:.2f}, {:.2f}, {:.2f}): give the site "
      "quat=\"{:.4g} {:.4g} {:.4g} {:.4g}\"",
      cfg.file.empty() ? "robot '" + cfg.name + "'" : cfg.file, group.name, group_cfg.leaf_site,
      z.x, z.y, z.z, in_tool.x, in_tool.y, in_tool.z, local.w, local.x, local.y, local.z));
}

}  // namespace

Robot::Robot(RobotCfg cfg, const mjModel* model, int num_worlds, std::string_view prefix,
             std::optional<ControlPeriods> periods)
    : cfg_(std::move(cfg)), model_(model), prefix_(prefix) {
  const std::string context = "robot '" + cfg_.name + "'";
  base_body_ = scene::resolve(model, mjOBJ_BODY, prefix_ + cfg_.base_body, context);
  check_groups(context, cfg_.groups.size());
  ControllerInit init{
      model,
      num_worlds,
      base_body_,
      periods.value_or(ControlPeriods{0.001 * cfg_.policy_dt_ms, 0.001 * cfg_.ctrl_dt_ms}),
      prefix_,
      context};
  std::vector<int> base_joints;
  for (const MoveGroupCfg& g : cfg_.groups) {
    init.context = context + ", move group '" + g.name + "'";
    MoveGroup group = resolve_group(g, model, prefix_, init.context);
    controllers_.push_back(make_controller(g.controller, group, init));
    controllers_.back()->describe(group);
    every_step_ |= controllers_.back()->every_step();
    const int index = static_cast<int>(groups_.size());
    if (g.kind == GroupKind::kArm && arm_ < 0) arm_ = index;
    if (g.kind == GroupKind::kGripper && gripper_ < 0) gripper_ = index;
    if (g.kind == GroupKind::kBase)
      base_joints.insert(base_joints.end(), group.joints.begin(), group.joints.end());
    groups_.push_back(std::move(group));
  }
  placement_ = BasePlacement(model, base_body_, base_joints, context);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (groups_[g].kind == GroupKind::kGripper)
      check_tool_frame(cfg_, cfg_.groups[g], groups_[g], model, make_data(model).get());
  }

  std::vector<int> moving;
  for (const MoveGroup& g : groups_) moving.insert(moving.end(), g.joints.begin(), g.joints.end());
  for (const MoveGroup& g : groups_) {
    auto& source = source_.emplace_back();
    if (g.leaf_site < 0) {
      chains_.push_back(nullptr);
      continue;
    }
    chains_.push_back(std::make_unique<Chain>(model, base_body_, g.leaf_site, moving));
    for (int joint : chains_.back()->joints()) {
      for (int k = 0; k < static_cast<int>(groups_.size()); ++k) {
        const auto& qpos = groups_[k].qpos;
        const auto at = std::find(qpos.begin(), qpos.end(), model->jnt_qposadr[joint]);
        if (at != qpos.end()) {
          source.emplace_back(k, static_cast<int>(at - qpos.begin()));
          break;
        }
      }
    }
  }
  targets_.resize(num_worlds);
}

int Robot::group_index(std::string_view name) const {
  const auto& group =
      find_named(groups_, &MoveGroup::name, name, "robot '" + cfg_.name + "'", "move group");
  return static_cast<int>(&group - groups_.data());
}

Pose Robot::base_pose(const World& world) const {
  return pose_from_mat(world.data->xpos + 3 * base_body_, world.data->xmat + 9 * base_body_);
}

Pose Robot::leaf_pose(const World& world, int group) const {
  const int site = groups_[group].leaf_site;
  if (site < 0) return base_pose(world);
  return site_pose(world.data, site);
}

Pose Robot::tcp_pose(const World& world, int group) const {
  return inverse(base_pose(world)) * leaf_pose(world, group);
}

double Robot::opening(const World& world, int gripper) const {
  return gripper_opening(groups_[gripper], world);
}

bool Robot::is_open(const World& world, int gripper) const {
  return gripper_is_open(groups_[gripper], world);
}

void Robot::read_qpos(const World& world, RobotValues& out) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const auto& address = groups_[g].qpos;
    out[g].size = static_cast<int>(address.size());
    out[g].given = true;
    for (std::size_t i = 0; i < address.size(); ++i)
      out[g].values[i] = world.data->qpos[address[i]];
  }
}

Pose Robot::fk(int group, const RobotValues& values) const {
  if (!chains_[group]) return {};
  double q[Chain::kMaxJoints];
  const auto& source = source_[group];
  for (std::size_t i = 0; i < source.size(); ++i) {
    const GroupValues& from = values[source[i].first];
    q[i] = from.values[source[i].second < from.size ? source[i].second : 0];
  }
  return chains_[group]->fk({q, source.size()});
}

bool Robot::ik(int group, const Pose& target, RobotValues& values, int max_iterations) const {
  if (!chains_[group]) return false;
  double q[Chain::kMaxJoints];
  bool moves[Chain::kMaxJoints];
  const auto& source = source_[group];
  for (std::size_t i = 0; i < source.size(); ++i) {
    const GroupValues& from = values[source[i].first];
    q[i] = from.values[source[i].second < from.size ? source[i].second : 0];
    moves[i] = source[i].first == group;
  }
  const std::size_t n = source.size();
  if (!chains_[group]->ik(target, {q, n}, max_iterations, 1e-4, {moves, n})) return false;
  for (std::size_t i = 0; i < n; ++i) {
    if (moves[i]) values[group].values[source[i].second] = q[i];
  }
  return true;
}

Pose Robot::target_pose(const World& world, int group) const {
  if (!chains_[group]) return {};
  const RobotValues& targets = targets_[world.id];
  double q[Chain::kMaxJoints];
  const auto& source = source_[group];
  for (std::size_t i = 0; i < source.size(); ++i) {
    const auto [g, k] = source[i];
    const GroupValues& from = targets[g];
    // A gripper's single target applies to all of its joints.
    q[i] =
        from.size > 0 ? from.values[k < from.size ? k : 0] : world.data->qpos[groups_[g].qpos[k]];
  }
  return chains_[group]->fk({q, source.size()});
}

void Robot::write_start(const StateRow& state, const std::optional<Pose>& base, Rng& rng) const {
  write_joints(state, rng);
  stand(state, base);
}

void Robot::stand(const StateRow& state, const std::optional<Pose>& base) const {
  if (base) placement_.write(state, *base);
  for (const auto& controller : controllers_) controller->start(state);
}

void Robot::write_joints(const StateRow& state, Rng& rng) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    const MoveGroupCfg& cfg = cfg_.groups[g];
    for (std::size_t i = 0; i < cfg.init.size(); ++i) {
      double q = cfg.init[i];
      if (!cfg.spread.empty()) q += rng.uniform(-cfg.spread[i], cfg.spread[i]);
      state.qpos[group.qpos[i]] = q;
    }
    if (!cfg.init.empty()) {
      for (int dof : group.dofs) state.qvel[dof] = 0;
      for (int joint : group.joints) {
        if (!model_->jnt_limited[joint] || model_->jnt_type[joint] == mjJNT_BALL) continue;
        double& q = state.qpos[model_->jnt_qposadr[joint]];
        q = std::clamp(q, model_->jnt_range[2 * joint], model_->jnt_range[2 * joint + 1]);
      }
    }
  }
}

void Robot::write_group(const StateRow& state, std::string_view name,
                        std::span<const double> positions) const {
  const MoveGroup& group = this->group(name);
  if (positions.size() != group.qpos.size())
    throw ValueError(fmt::format("robot '{}': group '{}' has {}, not {}", cfg_.name, name,
                                 counted(group.qpos.size(), "joint position"), positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) state.qpos[group.qpos[i]] = positions[i];
  for (int dof : group.dofs) state.qvel[dof] = 0;
}

bool Robot::lower_torso() {
  bool any = false;
  for (MoveGroupCfg& group : cfg_.groups) {
    if (group.low_init.empty()) continue;
    group.init = group.low_init;
    any = true;
  }
  return any;
}

// Returns the target of a group and marks it as having no command.
std::span<double> Robot::holding(int world, int g) {
  GroupValues& target = targets_[world][g];
  target.size = groups_[g].target_size;
  target.given = false;
  return {target.values.data(), static_cast<std::size_t>(target.size)};
}

void Robot::reset(const World& world) {
  for (std::size_t g = 0; g < groups_.size(); ++g)
    controllers_[g]->reset(world, holding(world.id, static_cast<int>(g)));
}

void Robot::command(const World& world, const Action& action) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    const GroupValues& wanted = action.commands[g];
    GroupValues& target = targets_[world.id][g];
    if (!wanted.given) {
      // The target is set in the first step without a command. Reading qpos in every step would let
      // the group drift.
      if (target.given) controllers_[g]->hold(world, holding(world.id, static_cast<int>(g)));
      continue;
    }
    if (wanted.size != group.command_size)
      throw ValueError(
          fmt::format("robot '{}': move group '{}' takes {} commands, but the action has {}",
                      cfg_.name, group.name, group.command_size, wanted.size));
    for (int i = 0; i < wanted.size; ++i) {
      if (!std::isfinite(wanted.values[i]))
        throw ValueError(fmt::format("robot '{}': command {} of move group '{}' is {}", cfg_.name,
                                     i, group.name, wanted.values[i]));
    }
    target.size = group.target_size;
    target.given = true;
    controllers_[g]->command(world, wanted.view(),
                             {target.values.data(), static_cast<std::size_t>(target.size)});
  }
}

std::vector<double> Robot::commands(const World& world, const Action& action) const {
  std::vector<double> row;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const auto n = static_cast<std::size_t>(groups_[g].command_size);
    if (n == 0) continue;
    row.resize(row.size() + n);
    const std::span<double> command = std::span(row).last(n);
    const GroupValues& wanted = action.commands[g];
    if (wanted.given) {
      std::ranges::copy(wanted.view(), command.begin());
      continue;
    }
    controllers_[g]->keep(world, targets_[world.id][g].view(), command);
  }
  return row;
}

void Robot::write_ctrl(const World& world, const StateRow& state, Rng* noise) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    GroupValues values = targets_[world.id][g];
    const std::span<double> target(values.values.data(), static_cast<std::size_t>(values.size));
    if (noise && group.kind == GroupKind::kArm && chains_[g] && group.targets_are_qpos()) {
      add_arm_noise(world, static_cast<int>(g), *noise, target);
    } else if (noise) {
      controllers_[g]->disturb(world, *noise, target);
    }
    controllers_[g]->begin(world, target, state);
  }
}

mjtStage Robot::control(const World& world, int index) const {
  mjtStage valid = mjSTAGE_ACC;
  const StateRow state = state_row(world.data);
  for (const auto& controller : controllers_) {
    if (controller->every_step()) valid = std::min(valid, controller->compute(world, index, state));
  }
  return valid;
}

void Robot::add_arm_noise(const World& world, int g, Rng& rng, std::span<double> target) const {
  const MoveGroup& group = groups_[g];
  const Chain& chain = *chains_[g];
  const std::size_t n = chain.joints().size();
  double q[Chain::kMaxJoints], jac[6 * Chain::kMaxJoints], dq[Chain::kMaxJoints];
  bool moves[Chain::kMaxJoints];
  RobotValues now;
  read_qpos(world, now);
  for (std::size_t i = 0; i < n; ++i) {
    const auto [from, k] = source_[g][i];
    q[i] = now[from].values[k];
    moves[i] = from == g;
  }
  chain.jacobian({q, n}, {jac, 6 * n});
  Vec3 move;
  for (std::size_t i = 0; i < n; ++i) {
    if (!moves[i]) continue;
    const double delta = target[source_[g][i].second] - q[i];
    move = move + delta * Vec3{jac[i], jac[n + i], jac[2 * n + i]};
  }
  const ActionNoiseCfg& cfg = cfg_.noise;
  const double deviation = cfg.scale * norm(move);
  const double rotation = cfg.rotation_ratio * deviation;
  double e[6];
  for (int i = 0; i < 3; ++i) e[i] = truncated_normal(rng, deviation, cfg.max_position);
  for (int i = 3; i < 6; ++i) e[i] = truncated_normal(rng, rotation, cfg.max_rotation);
  chain.joint_motion({q, n}, {{e[0], e[1], e[2]}, {e[3], e[4], e[5]}}, {dq, n}, {moves, n});
  double largest = cfg.max_joint;
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, std::abs(dq[i]));
  for (std::size_t i = 0; i < n; ++i) {
    if (!moves[i]) continue;
    const int k = source_[g][i].second;
    const double noisy = target[k] + cfg.max_joint / largest * dq[i];
    target[k] = std::clamp(noisy, group.ctrl_low[k], group.ctrl_high[k]);
  }
}

}  // namespace mjsense::tasks::robots
