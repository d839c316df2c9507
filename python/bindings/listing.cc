// SPDX-License-Identifier: Apache-2.0
// The lists of the commands `tasks`, `robots`, `scenes` and `objects`, as JSON.

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/object_catalogue.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {
namespace {

using Json = nlohmann::ordered_json;

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

Json entry(const std::string& name, const std::string& description, const std::string& needs) {
  return {{"name", name}, {"description", description}, {"needs", needs}};
}

std::string tasks_json() {
  Json out = Json::array();
  for (const std::string& name : tasks::rollout::task_names()) {
    const auto* known =
        std::ranges::find_if(kTasks, [&](const auto& one) { return name == one.name; });
    if (known == std::end(kTasks)) {
      out.push_back(entry(name, "", ""));
      continue;
    }
    out.push_back(entry(
        name, known->what,
        fmt::format("{} Default: {} in {}.", known->needs, tasks::rollout::default_robot(name),
                    tasks::rollout::default_scene(tasks::rollout::task_components(name)[0]))));
  }
  return out.dump(2);
}

std::string robots_json() {
  Json out = Json::array();
  for (const std::string& name : tasks::robots::robot_names())
    out.push_back(entry(name, tasks::robots::robot_cfg(name).description, ""));
  return out.dump(2);
}

std::string scenes_json() {
  Json out = Json::array();
  for (const std::string& name : tasks::scenes::scene_names()) {
    const tasks::scenes::SceneFileCfg scene = tasks::scenes::load_scene(name);
    const char* houses = !scene.generator.empty() ? " Each house number gives a different house."
                         : scene.catalogue_count >= 0 ? " Each house number gives other objects."
                                                      : "";
    out.push_back(entry(name, scene.description + houses, packages_of(scene)));
  }
  return out.dump(2);
}

std::string objects_json() {
  Json out = Json::array();
  for (const tasks::scenes::CatalogueObjectCfg& object :
       tasks::scenes::object_catalogue().objects) {
    const tasks::scenes::ObjectSourceCfg& source = tasks::scenes::source_of(object);
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
                   {"installed", tasks::scenes::is_installed(object)},
                   {"excluded", object.excluded}});
  }
  return out.dump(2);
}

}  // namespace

void bind_listing(nanobind::module_& m) {
  m.def("tasks_json", &tasks_json, "What `mjsense tasks --json` prints.");
  m.def("robots_json", &robots_json, "What `mjsense robots --json` prints.");
  m.def("scenes_json", &scenes_json, "What `mjsense scenes --json` prints.");
  m.def("objects_json", &objects_json, "What `mjsense objects --json` prints.");
}

}  // namespace mjsense::python
