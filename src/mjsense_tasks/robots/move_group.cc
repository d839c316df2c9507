// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/move_group.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/action.h"

namespace mjsense::tasks::robots {
namespace {

int qpos_width(int joint_type) {
  return joint_type == mjJNT_FREE ? 7 : joint_type == mjJNT_BALL ? 4 : 1;
}

int dof_width(int joint_type) {
  return joint_type == mjJNT_FREE ? 6 : joint_type == mjJNT_BALL ? 3 : 1;
}

void check_size(const std::string& context, const char* what, std::size_t found) {
  if (found > GroupValues::kMaxSize) {
    throw ValueError(
        fmt::format("{}: {} {}: the maximum is {}", context, found, what, GroupValues::kMaxSize));
  }
}

// The start positions of sliding and hinged joints are within their ranges.
void check_init(const mjModel* model, const MoveGroup& group, const MoveGroupCfg& cfg,
                const std::string& context) {
  std::size_t at = 0;
  for (std::size_t i = 0; i < group.joints.size(); ++i) {
    const int joint = group.joints[i];
    const double value = cfg.init[at], *range = model->jnt_range + 2 * joint;
    at += qpos_width(model->jnt_type[joint]);
    if (!model->jnt_limited[joint] || qpos_width(model->jnt_type[joint]) != 1) continue;
    if (range[0] - 1e-6 <= value && value <= range[1] + 1e-6) continue;
    throw ValueError(
        fmt::format("{}: the start position (init) of joint '{}' is {:g}, outside of its "
                    "range [{:g}, {:g}]",
                    context, cfg.joints[i], value, range[0], range[1]));
  }
}

}  // namespace

MoveGroup resolve_group(const MoveGroupCfg& cfg, const mjModel* model, const std::string& prefix,
                        const std::string& context) {
  validate(cfg, context);
  const auto find = [&](mjtObj type, const std::string& name) {
    return scene::resolve(model, type, prefix + name, context);
  };
  MoveGroup group;
  group.name = cfg.name;
  group.kind = cfg.kind;
  for (const std::string& name : cfg.joints) {
    const int id = find(mjOBJ_JOINT, name), type = model->jnt_type[id];
    group.joints.push_back(id);
    for (int k = 0; k < qpos_width(type); ++k) group.qpos.push_back(model->jnt_qposadr[id] + k);
    for (int k = 0; k < dof_width(type); ++k) group.dofs.push_back(model->jnt_dofadr[id] + k);
  }
  for (const std::string& name : cfg.actuators) {
    const int id = find(mjOBJ_ACTUATOR, name);
    const bool limited = model->actuator_ctrllimited[id];
    group.actuators.push_back(id);
    group.ctrl_low.push_back(limited ? model->actuator_ctrlrange[2 * id] : -mjMAXVAL);
    group.ctrl_high.push_back(limited ? model->actuator_ctrlrange[2 * id + 1] : mjMAXVAL);
  }
  check_size(context, "joint positions", group.qpos.size());
  check_size(context, "actuators", group.actuators.size());
  if (!cfg.init.empty() && cfg.init.size() != group.qpos.size()) {
    throw ValueError(fmt::format(
        "{}: {} (init) for {} with {}", context, counted(cfg.init.size(), "start position"),
        counted(cfg.joints.size(), "joint"), counted(group.qpos.size(), "position")));
  }
  if (!cfg.init.empty()) check_init(model, group, cfg, context);
  if (!cfg.leaf_site.empty()) group.leaf_site = find(mjOBJ_SITE, cfg.leaf_site);
  if (!cfg.root_body.empty()) group.root_body = find(mjOBJ_BODY, cfg.root_body);
  group.open_command = cfg.open_command;
  group.closed_command = cfg.closed_command;
  group.max_opening = cfg.max_opening;
  if (group.kind == GroupKind::kGripper) {
    for (int i = 0; i < 2; ++i) group.pad_sites[i] = find(mjOBJ_SITE, cfg.pad_sites[i]);
  }
  return group;
}

double gripper_opening(const MoveGroup& gripper, const World& world) {
  const auto& pads = gripper.pad_sites;
  return norm(vec3(world.data->site_xpos + 3 * pads[0]) -
              vec3(world.data->site_xpos + 3 * pads[1]));
}

bool gripper_is_open(const MoveGroup& gripper, const World& world) {
  return gripper_opening(gripper, world) > 0.5 * gripper.max_opening;
}

}  // namespace mjsense::tasks::robots
