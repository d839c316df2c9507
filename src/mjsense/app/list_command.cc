// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/list_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "mjsense/app/table.h"
#include "mjsense/robots/load_robot.h"
#include "mjsense/rollout/registry.h"
#include "mjsense/rollout/task_defaults.h"
#include "mjsense/scenes/load_scene.h"

namespace mjsense {
namespace {

struct Line {
  std::string name, what, needs;
};

std::string text_of(const char* kind, const std::vector<Line>& lines, bool json) {
  if (json) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const Line& line : lines)
      out.push_back({{"name", line.name}, {"description", line.what}, {"needs", line.needs}});
    return out.dump(2);
  }
  const bool needs =
      std::ranges::any_of(lines, [](const Line& line) { return !line.needs.empty(); });
  Table table{{kind, "what"}, needs ? "lll" : "ll", {}};
  if (needs) table.header.push_back("needs");
  for (const Line& line : lines) {
    table.rows.push_back({line.name, line.what});
    if (needs) table.rows.back().push_back(line.needs);
  }
  return table.text();
}

// Of our tasks; a task of somebody else's has its name alone.
constexpr struct {
  const char *name, *what, *needs;
} kTasks[] = {
    {"pick", "Pick up one of the things of a scene.", "arm and gripper; things to hold"},
    {"pick_and_place", "Put a thing in or on a receptacle.",
     "arm and gripper; things, receptacles"},
    {"pick_and_place_next_to", "Put a thing next to another.", "arm and gripper; things"},
    {"pick_and_place_color", "Put a thing in or on the receptacle of a colour.",
     "arm and gripper; things, receptacles"},
    {"packing", "Put a thing into a box.", "arm and gripper; things, a box"},
    {"open", "Open a drawer, a cabinet, a microwave, a fridge.",
     "arm and gripper; something with a handle that opens"},
    {"close", "Close a drawer, a cabinet, a microwave, a fridge.",
     "arm and gripper; something with a handle that opens"},
    {"door_opening", "Open a door by its handle.", "a base that drives, arm and gripper; a door"},
    {"nav_to_obj", "Drive to a thing.", "a base that drives, a head camera; things"},
    {"multi_task", "Any of several tasks in one scene: nav_to_obj+pick, or others named so.",
     "what each of them needs"},
};

// Packages that entities of a scene come from: "package:<package>/...".
std::string packages_of(const SceneFileCfg& scene) {
  std::vector<std::string> found;
  for (const SceneEntityCfg& entity : scene.entities) {
    constexpr std::string_view kPrefix = "package:";
    if (!entity.model.starts_with(kPrefix)) continue;
    const std::string inside = entity.model.substr(kPrefix.size());
    const std::string package = inside.substr(0, inside.find('/'));
    if (std::ranges::find(found, package) == found.end()) found.push_back(package);
  }
  std::string text;
  for (const std::string& one : found)
    text += fmt::format("{}Python package {}", text.empty() ? "" : ", ", one);
  return text;
}

}  // namespace

std::string list_tasks(bool json) {
  std::vector<Line> lines;
  for (const std::string& name : task_names()) {
    Line line{name, "", ""};
    for (const auto& one : kTasks) {
      if (name == one.name) line = {name, one.what, one.needs};
    }
    if (!line.what.empty())
      line.needs += fmt::format("; by default {} in {}", default_robot(name),
                                default_scene(parts_of_task(name)[0]));
    lines.push_back(line);
  }
  return text_of("task", lines, json);
}

std::string list_robots(bool json) {
  std::vector<Line> lines;
  for (const std::string& name : robot_names())
    lines.push_back({name, robot_cfg(name).description, ""});
  return text_of("robot", lines, json);
}

std::string list_scenes(bool json) {
  std::vector<Line> lines;
  for (const std::string& name : scene_names()) {
    const SceneFileCfg scene = load_scene(name);
    const char* houses = scene.generator.empty() ? "" : " A house for every number.";
    lines.push_back({name, scene.description + houses, packages_of(scene)});
  }
  return text_of("scene", lines, json);
}

}  // namespace mjsense
