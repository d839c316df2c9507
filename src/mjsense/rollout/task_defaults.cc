// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rollout/task_defaults.h"

namespace mjsense {
namespace {

// MolmoSpaces' configurations; 0: the robot's.
struct Defaults {
  std::string_view task;
  int horizon, policy_dt_ms, ctrl_dt_ms, sim_dt_ms;
};
constexpr Defaults kDefaults[] = {
    {"door_opening", 400, 0, 0, 0},
    {"nav_to_obj", 500, 200, 2, 2},
};

constexpr std::string_view kAnyOf = "nav_to_obj+pick";

}  // namespace

std::vector<std::string> parts_of_task(std::string_view name) {
  if (name == "multi_task") name = kAnyOf;
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t end = name.find('+');
    parts.emplace_back(name.substr(0, end));
    if (end == std::string_view::npos) return parts;
    name.remove_prefix(end + 1);
  }
}

std::string_view default_scene(std::string_view task) {
  if (task == "pick") return "table";
  if (task == "open" || task == "close") return "kitchen";
  if (task == "door_opening") return "room_with_door";
  if (task == "nav_to_obj") return "floor";
  return task == "packing" || task.starts_with("pick_and_place") ? "tableware" : "";
}

void set_task_defaults(std::string_view task, TaskCfg& cfg) {
  const std::string first = parts_of_task(task)[0];
  for (const Defaults& d : kDefaults) {
    if (d.task != first) continue;
    cfg.horizon = d.horizon;
    if (d.policy_dt_ms > 0) cfg.policy_dt_ms = d.policy_dt_ms;
    if (d.ctrl_dt_ms > 0) cfg.ctrl_dt_ms = d.ctrl_dt_ms;
    if (d.sim_dt_ms > 0) cfg.sim_dt_ms = d.sim_dt_ms;
    return;
  }
}

}  // namespace mjsense
