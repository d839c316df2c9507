// SPDX-License-Identifier: Apache-2.0
#pragma once
// Test fixture for planners: a robot at a table with objects on it.

#include <memory>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::policies {

// A robot at a table in plain MuJoCo.
struct TableStage {
  explicit TableStage(const char* robot_name) {
    episode::TaskCfg cfg = episode::task_cfg(robot_name, "table");
    cfg.action_noise = false;
    task = std::make_unique<tasks::PickTask>(cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), 1);
    data.reset(mj_makeData(scene->model()));
    world = {.id = 0, .model = scene->model(), .data = data.get()};
    task->sample(0, 0, robots::state_row(data.get()));
    mj_forward(world.model, world.data);
    task->begin(world);
  }
  const robots::Robot& robot() const { return task->robot(); }
  void step(const robots::Action& action) {
    task->apply(world, action, robots::state_row(world.data));
    physics_steps(*task, world, data.get());
  }
  std::unique_ptr<tasks::PickTask> task;
  std::unique_ptr<scene::Scene> scene;
  DataPtr data;
  World world;
};

}  // namespace mjsense::tasks::policies
