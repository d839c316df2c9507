// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense sensors SCENE.xml|TASK`: lists every stream, its meaning and its cost.

#include <string>
#include <vector>

#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::app {

struct SensorsOptions {
  std::string what;                    // an MJCF file, or the name of a task
  tasks::rollout::RolloutCfg rollout;  // options of a task
  int steps = 20;  // control steps over which the cost is measured; 0: do not measure
  bool json = false;
  std::vector<std::string> given;  // names of the options given on the command line
};

int run_sensors(const SensorsOptions& options);

}  // namespace mjsense::app
