// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/registry.h"

#include <fmt/format.h>

#include <mutex>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense_tasks/rollout/planners.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"
#include "mjsense_tasks/tasks/multi_task/multi_task.h"
#include "mjsense_tasks/tasks/multi_task/nav_and_pick.h"
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"
#include "mjsense_tasks/tasks/opening/opening.h"
#include "mjsense_tasks/tasks/pick/pick.h"
#include "mjsense_tasks/tasks/pick_and_place/pick_and_place.h"

namespace mjsense::tasks::rollout {
namespace {

// Factories by name. `group` and `kind` are for messages: "tasks", "task".
template <class Factory>
class Registry {
 public:
  struct Entry {
    std::string name;
    Factory make;
  };
  Registry(const char* group, const char* kind, std::vector<Entry> ours)
      : group_(group), kind_(kind), entries_(std::move(ours)) {}

  std::vector<std::string> names() const {
    const std::lock_guard lock(mutex_);
    return names_of(entries_, &Entry::name);
  }
  Factory at(std::string_view name) const {
    const std::lock_guard lock(mutex_);
    return find_named(entries_, &Entry::name, name, group_, kind_).make;
  }
  void add(std::string name, Factory make) {
    if (name.empty()) throw ValueError(fmt::format("a {} needs a name", kind_));
    const std::lock_guard lock(mutex_);
    for (const Entry& entry : entries_) {
      if (name == entry.name)
        throw ValueError(fmt::format("a {} named '{}' is already registered", kind_, name));
    }
    entries_.push_back({std::move(name), std::move(make)});
  }

 private:
  const char *group_, *kind_;
  mutable std::mutex mutex_;
  std::vector<Entry> entries_;
};

template <tasks::PlaceKind kind>
std::unique_ptr<episode::Task> pick_and_place(episode::TaskCfg cfg) {
  return std::make_unique<tasks::PickAndPlaceTask>(kind, std::move(cfg));
}

std::unique_ptr<episode::Task> any_of(std::string_view name, episode::TaskCfg cfg);

Registry<TaskFactory>& tasks() {
  static Registry<TaskFactory> all(
      "tasks", "task",
      {{"pick", [](episode::TaskCfg c) { return std::make_unique<tasks::PickTask>(std::move(c)); }},
       {"open",
        [](episode::TaskCfg c) {
          return std::make_unique<tasks::OpeningTask>(std::move(c), tasks::OpeningKind::kOpen);
        }},
       {"close",
        [](episode::TaskCfg c) {
          return std::make_unique<tasks::OpeningTask>(std::move(c), tasks::OpeningKind::kClose);
        }},
       {"pick_and_place", pick_and_place<tasks::PlaceKind::kInOrOn>},
       {"pick_and_place_next_to", pick_and_place<tasks::PlaceKind::kNextTo>},
       {"pick_and_place_color", pick_and_place<tasks::PlaceKind::kColor>},
       {"packing", pick_and_place<tasks::PlaceKind::kPacking>},
       {"door_opening",
        [](episode::TaskCfg c) { return std::make_unique<tasks::DoorOpeningTask>(std::move(c)); }},
       {"nav_to_obj",
        [](episode::TaskCfg c) { return std::make_unique<tasks::NavToObjTask>(std::move(c)); }},
       {"nav_and_pick",
        [](episode::TaskCfg c) {
          if (c.scene.empty()) c.scene = default_scene("nav_and_pick");
          return std::make_unique<tasks::NavAndPickTask>(c);
        }},
       {"multi_task", [](episode::TaskCfg c) { return any_of("multi_task", std::move(c)); }}});
  return all;
}

// Combines several tasks in the scene of the first one.
std::unique_ptr<episode::Task> any_of(std::string_view name, episode::TaskCfg cfg) {
  const std::vector<std::string> parts = task_components(name);
  for (const std::string& part : parts) tasks().at(part);  // throws for unknown names
  if (cfg.scene.empty()) cfg.scene = default_scene(parts[0]);
  if (cfg.scene.empty() && !cfg.make_scene) {
    throw ValueError(fmt::format(
        "task '{}': '{}' has no default scene that the other tasks can use: set the scene", name,
        parts[0]));
  }
  std::vector<std::unique_ptr<episode::Task>> children;
  children.reserve(parts.size());
  for (const std::string& part : parts) children.push_back(tasks().at(part)(cfg));
  return std::make_unique<tasks::MultiTask>(std::string(name), std::move(cfg), std::move(children));
}

Registry<PolicyFactory>& policies() {
  static Registry<PolicyFactory> all(
      "policies", "policy",
      {{"planner", make_any_planner}, {"top_down_planner", make_top_down_planner}});
  return all;
}

}  // namespace

std::vector<std::string> task_names() { return tasks().names(); }
std::vector<std::string> policy_names() { return policies().names(); }

std::unique_ptr<episode::Task> make_task(std::string_view name, episode::TaskCfg cfg) {
  if (name.find('+') != std::string_view::npos) return any_of(name, std::move(cfg));
  return tasks().at(name)(std::move(cfg));
}

std::unique_ptr<episode::Policy> make_policy(std::string_view name) {
  return policies().at(name)();
}

void register_task(std::string name, TaskFactory make) {
  tasks().add(std::move(name), std::move(make));
}

void register_policy(std::string name, PolicyFactory make) {
  policies().add(std::move(name), std::move(make));
}

}  // namespace mjsense::tasks::rollout
