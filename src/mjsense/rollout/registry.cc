// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rollout/registry.h"

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/pick_planner.h"
#include "mjsense/robots/franka/franka.h"
#include "mjsense/tasks/pick/pick.h"

namespace mjsense {
namespace {

template <class Make>
struct Entry {
  const char* name;
  Make* make;
};

constexpr Entry<RobotCfg()> kRobots[] = {
    {"franka", franka_cfg},
};

constexpr Entry<std::unique_ptr<Task>(TaskCfg)> kTasks[] = {
    {"pick",
     [](TaskCfg c) -> std::unique_ptr<Task> { return std::make_unique<PickTask>(std::move(c)); }},
};

constexpr Entry<std::unique_ptr<Policy>()> kPolicies[] = {
    {"planner", []() -> std::unique_ptr<Policy> { return std::make_unique<PickPlanner>(); }},
};

template <class Make, std::size_t N>
std::vector<std::string> names_of(const Entry<Make> (&entries)[N]) {
  std::vector<std::string> names;
  for (const Entry<Make>& entry : entries) names.emplace_back(entry.name);
  return names;
}

// `group` and `kind` are for the message: "robots", "robot".
template <class Make, std::size_t N>
Make* look_up(const Entry<Make> (&entries)[N], const char* group, const char* kind,
              std::string_view name) {
  for (const Entry<Make>& entry : entries) {
    if (name == entry.name) return entry.make;
  }
  throw_unknown(group, kind, name, names_of(entries));
}

}  // namespace

std::vector<std::string> robot_names() { return names_of(kRobots); }
std::vector<std::string> task_names() { return names_of(kTasks); }
std::vector<std::string> policy_names() { return names_of(kPolicies); }

RobotCfg robot_cfg(std::string_view name) { return look_up(kRobots, "robots", "robot", name)(); }

std::unique_ptr<Task> make_task(std::string_view name, TaskCfg cfg) {
  return look_up(kTasks, "tasks", "task", name)(std::move(cfg));
}

std::unique_ptr<Policy> make_policy(std::string_view name) {
  return look_up(kPolicies, "policies", "policy", name)();
}

}  // namespace mjsense
