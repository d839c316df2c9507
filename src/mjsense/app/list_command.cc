// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/list_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "mjsense/app/terminal.h"
#include "mjsense/app/text_table.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/object_catalogue.h"

namespace mjsense::app {
namespace {

constexpr std::size_t kMaxWidth = 100;  // longer lines are hard to read

struct Line {
  std::string name, what, needs;
};

std::string text_of(const std::vector<Line>& lines, bool json) {
  if (json) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const Line& line : lines)
      out.push_back({{"name", line.name}, {"description", line.what}, {"needs", line.needs}});
    return out.dump(2);
  }
  const std::size_t width = std::clamp(terminal_width(STDOUT_FILENO), std::size_t{40}, kMaxWidth);
  std::string out;
  const auto add = [&](const std::string& text) {
    for (const std::string& one : wrap(text, width - 4)) out += "    " + one + "\n";
  };
  for (const Line& line : lines) {
    out += line.name + "\n";
    if (!line.what.empty()) add(line.what);
    if (!line.needs.empty()) add("Needs: " + line.needs);
  }
  return out;
}

// Built-in tasks. User-defined tasks are listed by name only.
constexpr struct {
  const char *name, *what, *needs;
} kTasks[] = {
    {"pick", "Pick up one of the objects of a scene.",
     "an arm with a gripper; a scene with graspable objects."},
    {"pick_and_place", "Put an object in or on a receptacle.",
     "an arm with a gripper; a scene with objects and receptacles."},
    {"pick_and_place_next_to", "Put an object next to another one.",
     "an arm with a gripper; a scene with objects."},
    {"pick_and_place_color", "Put an object in or on the receptacle of a given colour.",
     "an arm with a gripper; a scene with objects and receptacles."},
    {"packing", "Put an object into a box.",
     "an arm with a gripper; a scene with objects and a box."},
    {"open", "Open a drawer, cabinet, microwave or fridge.",
     "an arm with a gripper; a scene with a door or drawer that has a handle."},
    {"close", "Close a drawer, cabinet, microwave or fridge.",
     "an arm with a gripper; a scene with a door or drawer that has a handle."},
    {"door_opening", "Open a door by its handle.",
     "a mobile base, an arm with a gripper; a scene with a door."},
    {"nav_to_obj", "Drive to an object.", "a mobile base, a head camera; a scene with objects."},
    {"nav_and_pick", "Drive to an object and pick it up.",
     "a mobile base, a head camera, an arm with a gripper; a scene with objects."},
    {"multi_task", "Several tasks in one scene, such as nav_to_obj+pick.",
     "everything that its tasks need."},
};

// Packages that entities of a scene come from: "package:<package>/...".
std::string packages_of(const tasks::scenes::SceneFileCfg& scene) {
  std::vector<std::string> found;
  for (const tasks::scenes::SceneEntityCfg& entity : scene.entities) {
    constexpr std::string_view kPrefix = "package:";  // of the model, or of files in its MJCF text
    const std::size_t at = entity.model.find(kPrefix);
    if (at == std::string::npos) continue;
    const std::string inside = entity.model.substr(at + kPrefix.size());
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
  for (const std::string& name : tasks::rollout::task_names()) {
    Line line{name, "", ""};
    for (const auto& one : kTasks) {
      if (name == one.name) line = {name, one.what, one.needs};
    }
    if (!line.what.empty())
      line.needs +=
          fmt::format(" Default: {} in {}.", tasks::rollout::default_robot(name),
                      tasks::rollout::default_scene(tasks::rollout::task_components(name)[0]));
    lines.push_back(line);
  }
  return text_of(lines, json);
}

std::string list_robots(bool json) {
  std::vector<Line> lines;
  for (const std::string& name : tasks::robots::robot_names())
    lines.push_back({name, tasks::robots::robot_cfg(name).description, ""});
  return text_of(lines, json);
}

std::string list_scenes(bool json) {
  std::vector<Line> lines;
  for (const std::string& name : tasks::scenes::scene_names()) {
    const tasks::scenes::SceneFileCfg scene = tasks::scenes::load_scene(name);
    const char* houses = !scene.generator.empty() ? " Each house number gives a different house."
                         : scene.catalogue_count >= 0 ? " Each house number gives other objects."
                                                      : "";
    lines.push_back({name, scene.description + houses, packages_of(scene)});
  }
  return text_of(lines, json);
}

std::string list_objects(bool json) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  Table table{{"name", "kind", "source", "licence", "installed", ""}, "", {}};
  for (const tasks::scenes::CatalogueObjectCfg& object :
       tasks::scenes::object_catalogue().objects) {
    const tasks::scenes::ObjectSourceCfg& source = tasks::scenes::source_of(object);
    const bool installed = tasks::scenes::is_installed(object);
    std::string note = object.receptacle ? "receptacle" : "";
    if (!object.excluded.empty()) note = "not used: " + object.excluded;
    table.rows.push_back(
        {object.name, object.kind, source.name, source.license, installed ? "yes" : "no", note});
    std::vector<std::string> meshes;
    for (const tasks::scenes::CataloguePartCfg& part : object.parts) meshes.push_back(part.mesh);
    out.push_back({{"name", object.name},
                   {"description", object.text},
                   {"kind", object.kind},
                   {"receptacle", object.receptacle},
                   {"source", source.name},
                   {"license", source.license},
                   {"url", source.url},
                   {"packages", source.packages},
                   {"model", object.model},
                   {"meshes", meshes},
                   {"installed", installed},
                   {"excluded", object.excluded}});
  }
  return json ? out.dump(2) : table.text();
}

}  // namespace mjsense::app
