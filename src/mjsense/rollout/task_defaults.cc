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

}  // namespace

void set_task_defaults(std::string_view task, TaskCfg& cfg) {
  for (const Defaults& d : kDefaults) {
    if (d.task != task) continue;
    cfg.horizon = d.horizon;
    if (d.policy_dt_ms > 0) cfg.policy_dt_ms = d.policy_dt_ms;
    if (d.ctrl_dt_ms > 0) cfg.ctrl_dt_ms = d.ctrl_dt_ms;
    if (d.sim_dt_ms > 0) cfg.sim_dt_ms = d.sim_dt_ms;
    return;
  }
}

}  // namespace mjsense
