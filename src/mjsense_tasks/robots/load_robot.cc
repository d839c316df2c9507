// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/load_robot.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>
#include <variant>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_value.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_parts.h"
#include "mjsense_tasks/robots/real_meshes.h"
#include "mjsense_tasks/robots/sensor_tables.h"

namespace mjsense::tasks::robots {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEmbedded = "embedded:";
constexpr DataFolder kRobots{"robot", "robots/", "/robot.toml"};

void check_unique(std::string_view context, const char* what, const std::string& name,
                  std::set<std::string>& seen) {
  if (name.empty()) throw ValueError(fmt::format("{}: a {} has an empty name", context, what));
  if (name.find('/') != std::string::npos)
    throw ValueError(fmt::format("{}: {} '{}': '/' is not allowed in a name", context, what, name));
  if (!seen.insert(name).second)
    throw ValueError(fmt::format("{}: duplicate {} '{}'", context, what, name));
}

// Throws KeyError unless the model has every element that `cfg` names.
void check_references(const RobotCfg& cfg, const mjSpec* spec, const std::string& path) {
  const auto check = [&](mjtObj type, const std::string& name, const std::string& context) {
    scene::find_in_spec(spec, type, name, context);
  };
  check(mjOBJ_BODY, cfg.base_body, path + ": base");
  for (const MoveGroupCfg& group : cfg.groups) {
    const std::string context = fmt::format("{}: move group '{}': ", path, group.name);
    for (const std::string& name : group.joints) check(mjOBJ_JOINT, name, context + "joints");
    for (const std::string& name : group.actuators)
      check(mjOBJ_ACTUATOR, name, context + "actuators");
    for (const std::string& name : group.pad_sites) check(mjOBJ_SITE, name, context + "pad_sites");
    if (!group.leaf_site.empty()) check(mjOBJ_SITE, group.leaf_site, context + "leaf_site");
    if (!group.root_body.empty()) check(mjOBJ_BODY, group.root_body, context + "root_body");
    if (const auto* base = std::get_if<FreeBaseCfg>(&group.controller))
      check(mjOBJ_BODY, base->target, context + "controller.target");
  }
  for (const CameraMount& camera : cfg.cameras)
    check(mjOBJ_CAMERA, camera.mjcf_camera, fmt::format("{}: camera '{}'", path, camera.name));
}

}  // namespace

void validate(const MoveGroupCfg& cfg, std::string_view context) {
  if (!cfg.spread.empty() && cfg.spread.size() != cfg.init.size()) {
    throw ValueError(fmt::format("{}: '{}': spread has {}, init has {}", context, cfg.name,
                                 counted(cfg.spread.size(), "value"), cfg.init.size()));
  }
  if (!cfg.low_init.empty() && cfg.low_init.size() != cfg.init.size()) {
    throw ValueError(fmt::format("{}: '{}': stooped has {}, init has {}", context, cfg.name,
                                 counted(cfg.low_init.size(), "value"), cfg.init.size()));
  }
  if (cfg.kind == GroupKind::kBase && !cfg.init.empty()) {
    throw ValueError(
        fmt::format("{}: the base '{}' must not have start positions (init): the task places it",
                    context, cfg.name));
  }
  if (cfg.kind != GroupKind::kGripper) return;
  if (cfg.pad_sites.size() != 2) {
    throw ValueError(fmt::format("{}: the gripper '{}' needs 2 pad_sites, has {}", context,
                                 cfg.name, cfg.pad_sites.size()));
  }
  if (cfg.root_body.empty()) {
    throw ValueError(
        fmt::format("{}: the gripper '{}' needs root_body, the body whose subtree is the gripper",
                    context, cfg.name));
  }
  if (cfg.leaf_site.empty()) {
    throw ValueError(fmt::format("{}: the gripper '{}' needs leaf_site, the site of its tool frame",
                                 context, cfg.name));
  }
  if (!cfg.actuators.empty() && cfg.open_command == cfg.closed_command) {
    throw ValueError(
        fmt::format("{}: the gripper '{}' has the same open_command and closed_command, {:g}",
                    context, cfg.name, cfg.open_command));
  }
  // Grasps are planned with these sizes: with 0 there is no grasp of any object.
  struct Size {
    const char *name, *meaning, *example;
    double value;
  };
  for (const Size& size :
       {Size{"max_opening", "the distance between its open pads", "0.08", cfg.max_opening},
        Size{"pad_half_width", "half the width of a pad across the approach, the tool's x axis",
             "0.01", cfg.pad_half_width},
        Size{"pad_half_length", "half the length of a pad along the approach, the tool's z axis",
             "0.02", cfg.pad_half_length}}) {
    if (size.value > 0) continue;
    throw ValueError(fmt::format(
        "{}: the gripper '{}' needs {}, {}, in m; it is {:g}: write for "
        "example {} = {}",
        context, cfg.name, size.name, size.meaning, size.value, size.name, size.example));
  }
}

void validate(const RobotCfg& cfg, std::string_view context) {
  std::set<std::string> groups, cameras;
  for (const MoveGroupCfg& group : cfg.groups)
    check_unique(context, "move group", group.name, groups);
  for (const CameraMount& camera : cfg.cameras)
    check_unique(context, "camera", camera.name, cameras);
  if (cfg.policy_dt_ms % cfg.ctrl_dt_ms != 0 || cfg.ctrl_dt_ms % cfg.sim_dt_ms != 0) {
    throw ValueError(
        fmt::format("{}: policy_dt_ms = {} must be a multiple of ctrl_dt_ms = {}, and that of "
                    "sim_dt_ms = {}",
                    context, cfg.policy_dt_ms, cfg.ctrl_dt_ms, cfg.sim_dt_ms));
  }
  if (!cfg.env_state_name.empty() && cfg.env_state_name == cfg.name) {
    throw ValueError(fmt::format("{}: env_state_name '{}' must differ from the robot's name",
                                 context, cfg.name));
  }
}

RobotCfg parse_robot(std::string_view text, const std::string& path) {
  RobotCfg cfg;
  cfg.file = path;
  const std::string file = path.starts_with(kEmbedded) ? path.substr(kEmbedded.size()) : path;
  cfg.name = fs::path(file).parent_path().filename().string();
  toml::table table = parse_toml(text, path);
  take_robot_sensors(table, path, cfg);
  read_toml_table(table, path, struct_of<RobotCfg>(), &cfg, "");
  if (cfg.name.empty()) throw ValueError(fmt::format("{}: 'name' is empty", path));
  cfg.model.path = resolve_relative(path, cfg.mjcf);
  const std::string context = fmt::format("robot '{}'", cfg.name);
  if (cfg.parts.empty()) {
    check_references(cfg, scene::parse_model(cfg.model, context).get(), path);
  } else {
    std::vector<scene::ModelPart> parts;
    for (const PartCfg& part : cfg.parts)
      parts.push_back(
          {resolve_relative(path, part.model), part.to, part.prefix, part.pos, part.quat});
    const std::shared_ptr<mjSpec> spec = scene::compose_model(cfg.model, parts, path);
    check_references(cfg, spec.get(), path);
    cfg.model = {.spec = spec.get(), .owner = spec};
  }
  if (cfg.meshes) cfg.edit_spec = use_meshes(*cfg.meshes, path);
  return cfg;
}

std::string robot_xml(const RobotCfg& cfg) {
  const std::string context = fmt::format("robot '{}'", cfg.name);
  const scene::SpecPtr spec = scene::parse_model(cfg.model, context);
  if (cfg.edit_spec) cfg.edit_spec(spec.get(), "");
  const scene::Vfs vfs;
  if (!compile(spec.get(), vfs))
    throw ValueError(fmt::format("{}: {}", context, scene::one_line(mjs_getError(spec.get()))));
  return scene::save_xml(spec.get());
}

std::vector<std::string> robot_names() { return kRobots.names(); }

RobotCfg robot_cfg(std::string_view name) {
  const DataFile file = kRobots.find(name);
  return parse_robot(file.text, file.path);
}

}  // namespace mjsense::tasks::robots
