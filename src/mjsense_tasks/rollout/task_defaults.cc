// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/task_defaults.h"

#include <algorithm>
#include <utility>

namespace mjsense::tasks::rollout {
namespace {

constexpr std::string_view kUsualRobot = "franka";

// Values of MolmoSpaces' configurations; 0: the robot's value.
struct Defaults {
  std::string_view task, robot;
  int horizon, policy_dt_ms, ctrl_dt_ms, sim_dt_ms;
};
constexpr Defaults kDefaults[] = {
    {"open", kUsualRobot, 200, 0, 0, 0},
    {"close", kUsualRobot, 200, 0, 0, 0},
    {"door_opening", "rby1", 400, 0, 0, 0},
    {"nav_to_obj", "rby1", 500, 200, 2, 2},
    {"nav_and_pick", "mobile_franka", 1200, 0, 0, 0},  // of 66 ms: 79 s
};
// For the other tasks with a robot of such a long control period: 400 steps of 100 ms are 40 s.
// TaskCfg's 500 steps of 66 ms are 33 s.
constexpr int kSeldomMs = 100, kSeldomHorizon = 400;

constexpr std::string_view kAnyOf = "nav_to_obj+pick";

const Defaults* defaults_of(std::string_view task) {
  const std::string first = task_components(task)[0];
  const auto* found = std::ranges::find(kDefaults, first, &Defaults::task);
  return found == std::end(kDefaults) ? nullptr : found;
}

}  // namespace

std::vector<std::string> task_components(std::string_view name) {
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
  static constexpr std::pair<std::string_view, std::string_view> kScenes[] = {
      {"pick", "varied_table"},
      {"pick_and_place", "tableware"},
      {"pick_and_place_next_to", "tableware"},
      {"pick_and_place_color", "tableware"},
      {"packing", "tableware"},
      {"open", "kitchen"},
      {"close", "kitchen"},
      {"door_opening", "room_with_door"},
      {"nav_to_obj", "floor"},
      {"nav_and_pick", "floor"}};
  const auto* found = std::ranges::find(kScenes, task, [](const auto& s) { return s.first; });
  return found == std::end(kScenes) ? "" : found->second;
}

std::string_view default_robot(std::string_view task) {
  const Defaults* d = defaults_of(task);
  return d ? d->robot : kUsualRobot;
}

void set_task_defaults(std::string_view task, episode::TaskCfg& cfg) {
  const Defaults* d = defaults_of(task);
  if (!d) {
    const bool ours = !default_scene(task_components(task)[0]).empty();
    if (ours && cfg.policy_dt_ms >= kSeldomMs) cfg.horizon = kSeldomHorizon;
    return;
  }
  cfg.horizon = d->horizon;
  if (d->policy_dt_ms > 0) cfg.policy_dt_ms = d->policy_dt_ms;
  if (d->ctrl_dt_ms > 0) cfg.ctrl_dt_ms = d->ctrl_dt_ms;
  if (d->sim_dt_ms > 0) cfg.sim_dt_ms = d->sim_dt_ms;
}

}  // namespace mjsense::tasks::rollout
