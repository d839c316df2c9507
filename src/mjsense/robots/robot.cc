// SPDX-License-Identifier: Apache-2.0
#include "mjsense/robots/robot.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"

namespace mjsense {
namespace {

constexpr int kMaxValues = GroupValues::kMaxSize;

void check_size(const std::string& place, const char* what, std::size_t found, std::size_t most) {
  if (found > most)
    throw ValueError(fmt::format("{}: {} {}, at most {} are possible", place, found, what, most));
}

double truncated_normal(Rng& rng, double deviation, double limit) {
  if (!(deviation > 0)) return 0.0;
  // Far inside the bell the distribution is flat, and rejection would take for ever.
  if (deviation > 100 * limit) return rng.uniform(-limit, limit);
  for (;;) {
    const double x = deviation * rng.normal();
    if (std::abs(x) <= limit) return x;
  }
}

// A servo whose control is a joint's position has its unit; others take what their range says.
std::string command_unit(const mjModel* m, const MoveGroup& group) {
  std::set<std::string> units;
  for (std::size_t i = 0; i < group.actuators.size(); ++i) {
    const int a = group.actuators[i];
    const double* gain = m->actuator_gainprm + mjNGAIN * a;
    const double* bias = m->actuator_biasprm + mjNBIAS * a;
    if (m->actuator_trntype[a] == mjTRN_JOINT && gain[0] != 0 && gain[0] == -bias[1]) {
      units.insert(m->jnt_type[m->actuator_trnid[2 * a]] == mjJNT_SLIDE ? "m" : "rad");
    } else if (group.kind == GroupKind::kGripper) {
      units.insert(
          fmt::format("{:g} open .. {:g} closed", group.open_command, group.closed_command));
    } else {
      units.insert(fmt::format("{:g} .. {:g}", group.ctrl_low[i], group.ctrl_high[i]));
    }
  }
  return fmt::format("{}", fmt::join(units, " or "));
}

}  // namespace

Robot::Robot(RobotCfg cfg, const mjModel* model, int num_worlds, std::string_view prefix)
    : cfg_(std::move(cfg)), model_(model), prefix_(prefix) {
  const std::string place = "robot '" + cfg_.name + "'";
  const auto find = [&](mjtObj type, const std::string& name) {
    return resolve(model, type, prefix_ + name, place);
  };
  base_body_ = find(mjOBJ_BODY, cfg_.base_body);
  base_mocap_ = model->body_mocapid[base_body_];
  check_size(place, "move groups", cfg_.groups.size(), RobotValues::kMaxGroups);
  for (const MoveGroupCfg& g : cfg_.groups) {
    const std::string group_place = place + ", move group '" + g.name + "'";
    check_size(group_place, "joints", g.joints.size(), kMaxValues);
    check_size(group_place, "actuators", g.actuators.size(), kMaxValues);
    if (!g.init.empty() && g.init.size() != g.joints.size())
      throw ValueError(fmt::format("{}: {} start positions for {} joints", group_place,
                                   g.init.size(), g.joints.size()));
    MoveGroup group;
    group.name = g.name;
    group.kind = g.kind;
    for (const std::string& name : g.joints) {
      const int id = find(mjOBJ_JOINT, name);
      group.joints.push_back(id);
      group.qpos.push_back(model->jnt_qposadr[id]);
      group.dofs.push_back(model->jnt_dofadr[id]);
    }
    for (const std::string& name : g.actuators) {
      const int id = find(mjOBJ_ACTUATOR, name);
      const bool limited = model->actuator_ctrllimited[id];
      group.actuators.push_back(id);
      group.ctrl_low.push_back(limited ? model->actuator_ctrlrange[2 * id] : -mjMAXVAL);
      group.ctrl_high.push_back(limited ? model->actuator_ctrlrange[2 * id + 1] : mjMAXVAL);
    }
    if (!g.leaf_site.empty()) group.leaf_site = find(mjOBJ_SITE, g.leaf_site);
    if (!g.root_body.empty()) group.root_body = find(mjOBJ_BODY, g.root_body);
    group.open_command = g.open_command;
    group.closed_command = g.closed_command;
    group.max_opening = g.max_opening;
    if (g.kind == GroupKind::kGripper) {
      if (g.pad_sites.size() != 2)
        throw ValueError(
            fmt::format("{}: needs 2 pad sites, has {}", group_place, g.pad_sites.size()));
      for (int i = 0; i < 2; ++i) group.pad_sites[i] = find(mjOBJ_SITE, g.pad_sites[i]);
    }
    const int index = static_cast<int>(groups_.size());
    if (g.kind == GroupKind::kArm && arm_ < 0) arm_ = index;
    if (g.kind == GroupKind::kGripper && gripper_ < 0) gripper_ = index;
    group.command_unit = command_unit(model, group);
    groups_.push_back(std::move(group));
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
        const auto& joints = groups_[k].joints;
        const auto at = std::find(joints.begin(), joints.end(), joint);
        if (at != joints.end()) source.emplace_back(k, static_cast<int>(at - joints.begin()));
      }
    }
  }
  targets_.resize(num_worlds);
}

int Robot::group_index(std::string_view name) const {
  std::vector<std::string> names;
  for (int g = 0; g < static_cast<int>(groups_.size()); ++g) {
    if (groups_[g].name == name) return g;
    names.push_back(groups_[g].name);
  }
  throw_unknown("robot '" + cfg_.name + "'", "move group", name, names);
}

Pose Robot::base_pose(const World& world) const {
  return pose_from_mat(world.data->xpos + 3 * base_body_, world.data->xmat + 9 * base_body_);
}

Pose Robot::leaf_pose(const World& world, int group) const {
  const int site = groups_[group].leaf_site;
  if (site < 0) return base_pose(world);
  return pose_from_mat(world.data->site_xpos + 3 * site, world.data->site_xmat + 9 * site);
}

Pose Robot::tcp_pose(const World& world, int group) const {
  return inverse(base_pose(world)) * leaf_pose(world, group);
}

double Robot::opening(const World& world, int gripper) const {
  const auto& pads = groups_[gripper].pad_sites;
  return norm(vec3(world.data->site_xpos + 3 * pads[0]) -
              vec3(world.data->site_xpos + 3 * pads[1]));
}

bool Robot::is_open(const World& world, int gripper) const {
  return opening(world, gripper) > 0.5 * groups_[gripper].max_opening;
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

void Robot::read_qvel(const World& world, RobotValues& out) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const auto& address = groups_[g].dofs;
    out[g].size = static_cast<int>(address.size());
    out[g].given = true;
    for (std::size_t i = 0; i < address.size(); ++i)
      out[g].values[i] = world.data->qvel[address[i]];
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

void Robot::write_start(const StateRow& state, const Pose& base, Rng& rng) const {
  if (base_mocap_ >= 0) {
    write_vec(base.p, state.mocap_pos + 3 * base_mocap_);
    write_quat(base.q, state.mocap_quat + 4 * base_mocap_);
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    const MoveGroupCfg& cfg = cfg_.groups[g];
    for (std::size_t i = 0; i < cfg.init.size(); ++i) {
      double q = cfg.init[i];
      if (!cfg.spread.empty()) q += rng.uniform(-cfg.spread[i], cfg.spread[i]);
      const int joint = group.joints[i];
      if (model_->jnt_limited[joint])
        q = std::clamp(q, model_->jnt_range[2 * joint], model_->jnt_range[2 * joint + 1]);
      state.qpos[group.qpos[i]] = q;
      state.qvel[group.dofs[i]] = 0;
    }
    if (group.kind == GroupKind::kActuators) continue;  // as the scene has them
    for (std::size_t i = 0; i < group.actuators.size(); ++i) {
      state.ctrl[group.actuators[i]] =
          group.kind == GroupKind::kGripper ? group.open_command : state.qpos[group.qpos[i]];
    }
  }
}

void Robot::hold(const World& world, int g, GroupValues& out) const {
  const MoveGroup& group = groups_[g];
  out.size = static_cast<int>(group.actuators.size());
  for (int i = 0; i < out.size; ++i) {
    const double value = group.kind == GroupKind::kActuators ? world.data->ctrl[group.actuators[i]]
                         : group.kind != GroupKind::kGripper ? world.data->qpos[group.qpos[i]]
                         : is_open(world, g)                 ? group.open_command
                                                             : group.closed_command;
    out.values[i] = std::clamp(value, group.ctrl_low[i], group.ctrl_high[i]);
  }
  out.given = false;
}

void Robot::reset(const World& world) {
  for (std::size_t g = 0; g < groups_.size(); ++g)
    hold(world, static_cast<int>(g), targets_[world.id][g]);
}

void Robot::command(const World& world, const Action& action) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    const GroupValues& wanted = action.commands[g];
    GroupValues& target = targets_[world.id][g];
    if (!wanted.given) {
      // Held from the first step that leaves the group out: reading qpos every step would let it
      // drift.
      if (target.given) hold(world, static_cast<int>(g), target);
      continue;
    }
    if (wanted.size != static_cast<int>(group.actuators.size()))
      throw ValueError(
          fmt::format("robot '{}': move group '{}' takes {} commands, the action has {}", cfg_.name,
                      group.name, group.actuators.size(), wanted.size));
    for (int i = 0; i < wanted.size; ++i) {
      if (!std::isfinite(wanted.values[i]))
        throw ValueError(fmt::format("robot '{}': command {} of move group '{}' is {}", cfg_.name,
                                     i, group.name, wanted.values[i]));
      target.values[i] = std::clamp(wanted.values[i], group.ctrl_low[i], group.ctrl_high[i]);
    }
    target.size = wanted.size;
    target.given = true;
  }
}

void Robot::write_ctrl(const World& world, const StateRow& state, Rng* noise) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const MoveGroup& group = groups_[g];
    GroupValues values = targets_[world.id][g];
    if (noise && group.kind == GroupKind::kArm)
      add_arm_noise(world, static_cast<int>(g), *noise,
                    {values.values.data(), static_cast<std::size_t>(values.size)});
    for (int i = 0; i < values.size; ++i) state.ctrl[group.actuators[i]] = values.values[i];
  }
}

void Robot::add_arm_noise(const World& world, int g, Rng& rng, std::span<double> target) const {
  const MoveGroup& group = groups_[g];
  const Chain& chain = *chains_[g];
  const std::size_t n = chain.joints().size();
  double q[Chain::kMaxJoints], jac[6 * Chain::kMaxJoints], dq[Chain::kMaxJoints];
  RobotValues now;
  read_qpos(world, now);
  for (std::size_t i = 0; i < n; ++i) q[i] = now[source_[g][i].first].values[source_[g][i].second];
  chain.jacobian({q, n}, {jac, 6 * n});
  Vec3 move;
  for (std::size_t i = 0; i < n; ++i) {
    const auto [from, k] = source_[g][i];
    if (from != g) continue;
    const double delta = target[k] - q[i];
    move = move + delta * Vec3{jac[i], jac[n + i], jac[2 * n + i]};
  }
  const ActionNoiseCfg& cfg = cfg_.noise;
  const double deviation = cfg.scale * norm(move);
  const double rotation = cfg.rotation_ratio * deviation;
  double e[6];
  for (int i = 0; i < 3; ++i) e[i] = truncated_normal(rng, deviation, cfg.max_position);
  for (int i = 3; i < 6; ++i) e[i] = truncated_normal(rng, rotation, cfg.max_rotation);
  chain.joint_motion({q, n}, {{e[0], e[1], e[2]}, {e[3], e[4], e[5]}}, {dq, n});
  for (std::size_t i = 0; i < n; ++i) {
    const auto [from, k] = source_[g][i];
    if (from == g) target[k] = std::clamp(target[k] + dq[i], group.ctrl_low[k], group.ctrl_high[k]);
  }
}

}  // namespace mjsense
