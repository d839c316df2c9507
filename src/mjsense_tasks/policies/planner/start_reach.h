// SPDX-License-Identifier: Apache-2.0
#pragma once
// Whether a robot can pick up the target of a picking task from its start pose: a short arm may not
// reach the top of a shelf, and a hand no grasp of an object that lies flat. A rollout then draws
// another start, whichever policy plays it.

#include <memory>

#include "mjsense_tasks/policies/planner/picking.h"

namespace mjsense::tasks::policies {

class StartReach {
 public:
  // Null for a task without a GraspScene and for a robot without hands. Also for one that drives: it
  // can go to where it reaches the target.
  static std::unique_ptr<StartReach> make(const episode::Task& task);
  explicit StartReach(const episode::Task& task);

  // True if the planner's first plan for a pick exists. `world` has the start state. Calls for
  // different worlds may run in parallel.
  bool operator()(const World& world);

 private:
  ManipulationPlannerCfg cfg_;
  Manipulation shared_;
  Placing placing_;
  Picking picking_;
  Follower follower_;
};

}  // namespace mjsense::tasks::policies
