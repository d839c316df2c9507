// SPDX-License-Identifier: Apache-2.0
#pragma once
// A task with its scene and one mjData, for tests of start states and evaluations.

#include <memory>
#include <string>
#include <utility>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::episode {

// With the robot's own periods.
inline TaskCfg task_cfg(const std::string& robot, const std::string& scene = "") {
  TaskCfg cfg;
  cfg.robot = robots::robot_cfg(robot);
  cfg.policy_dt_ms = cfg.robot.policy_dt_ms;
  cfg.ctrl_dt_ms = cfg.robot.ctrl_dt_ms;
  cfg.sim_dt_ms = cfg.robot.sim_dt_ms;
  cfg.scene = scene;
  return cfg;
}

template <class SomeTask>
struct PlayedTask {
  explicit PlayedTask(TaskCfg cfg, int num_worlds = 1)
      : task(std::move(cfg)), scene(task.scene_cfg_with_robot()) {
    task.initialize(model, num_worlds);
  }
  // Starts the episode in world 0.
  void start(std::int64_t episode) {
    mj_resetData(model, data.get());
    task.sample(0, episode, robots::state_row(data.get()));
    mj_forward(model, data.get());
    world = {.id = 0, .model = model, .data = data.get()};
    task.begin(world);
  }

  SomeTask task;
  scene::Scene scene;
  const mjModel* model = scene.model();
  DataPtr data = make_data(model);
  World world;
};

}  // namespace mjsense::tasks::episode
