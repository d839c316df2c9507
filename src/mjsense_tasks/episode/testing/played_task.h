// SPDX-License-Identifier: Apache-2.0
#pragma once
// A task with its scene and one mjData, for tests of start states and evaluations.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/text/json.h"
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
  // `arguments`: those of the task's constructor.
  template <class... Arguments>
  explicit PlayedTask(int num_worlds, Arguments&&... arguments)
      : task(std::forward<Arguments>(arguments)...), scene(task.scene_cfg_with_robot()) {
    task.initialize(model, num_worlds);
  }
  // Starts the episode in a world.
  const World& start(std::int64_t episode, int id = 0) {
    mj_resetData(model, data.get());
    task.sample(id, episode, robots::state_row(data.get()));
    mj_forward(model, data.get());
    world = {.id = id, .model = model, .data = data.get()};
    task.begin(world);
    return world;
  }
  // What the task records about the current state.
  nlohmann::json info() const {
    std::vector<std::uint8_t> text(4000);
    JsonWriter json(text);
    json.finite_only().begin_object();
    task.write_info(world, json);
    json.end_object();
    EXPECT_TRUE(json.finish());
    return nlohmann::json::parse(reinterpret_cast<const char*>(text.data()));
  }
  double* qpos_of(int body) { return data->qpos + model->jnt_qposadr[model->body_jntadr[body]]; }
  std::vector<double> qpos() const { return {data->qpos, data->qpos + model->nq}; }

  SomeTask task;
  scene::Scene scene;
  const mjModel* model = scene.model();
  DataPtr data = make_data(model);
  World world;
};

}  // namespace mjsense::tasks::episode
