// SPDX-License-Identifier: Apache-2.0
#pragma once
// Runs one episode of a task with plain MuJoCo, without sensors; for tests and benchmarks.

#include <mujoco/mujoco.h>

#include <chrono>
#include <cstdint>
#include <functional>

#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"

namespace mjsense::tasks::policies {

// The physics of one policy step with the controllers that run in it; afterwards derived fields are
// current.
inline void physics_steps(episode::Task& task, World& world, mjData* data,
                          const std::function<void(const World&)>& each_physics_step = {}) {
  const bool controlled = task.robot().controls_every_step();
  for (int i = 0; i < task.decimation(); ++i) {
    if (controlled && i > 0 && i % task.control_decimation() == 0) {
      mj_forward(world.model, data);
      task.robot().control(world, i / task.control_decimation());
    }
    mj_step(world.model, data);
    if (each_physics_step) each_physics_step(world);
  }
  mj_forward(world.model, data);
  world.substep += task.decimation();
}

struct EpisodeResult {
  int steps = 0;  // policy steps
  bool success = false;
  bool gave_up = false;
  bool truncated = false;
  double reward = 0;        // of the last evaluation
  double first_plan_s = 0;  // wall time
};

inline EpisodeResult run_episode(episode::Task& task, episode::Policy& policy, mjData* data,
                                 int world_id, std::int64_t episode,
                                 const std::function<void(const World&)>& each_step = {},
                                 const std::function<void(const World&)>& at_start = {},
                                 const std::function<void(const World&)>& each_physics_step = {}) {
  const mjModel* model = task.model();
  mj_resetData(model, data);
  task.sample(world_id, episode, robots::state_row(data));
  mj_forward(model, data);
  World world{.id = world_id, .model = model, .data = data};
  world.first = true;
  task.begin(world);
  if (at_start) at_start(world);
  EpisodeResult result;
  const auto before = std::chrono::steady_clock::now();
  policy.reset(world);
  result.first_plan_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
  robots::Action action;
  for (;;) {
    policy.act(world, action);
    task.apply(world, action, robots::state_row(data));
    physics_steps(task, world, data, each_physics_step);
    world.first = false;
    ++result.steps;
    if (each_step) each_step(world);
    const episode::Evaluation e = task.evaluate(world);
    result.success = e.success;
    result.reward = e.reward;
    result.truncated = e.truncated;
    result.gave_up = action.success.has_value() && !*action.success;
    if (e.terminal || e.truncated) return result;
  }
}

}  // namespace mjsense::tasks::policies
