// SPDX-License-Identifier: Apache-2.0
#pragma once
// A robot without other objects, in one world, for tests.

#include <memory>
#include <utility>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {

struct LoneRobot {
  explicit LoneRobot(RobotCfg of) : cfg(std::move(of)) {
    scene::SceneCfg scene_cfg;
    scene_cfg.entities.emplace_back("robot_0", scene::EntityCfg{.model = cfg.model});
    scene_cfg.options.timestep = 0.001 * cfg.sim_dt_ms;
    scene = std::make_unique<scene::Scene>(scene_cfg);
    model = scene->model();
    robot = std::make_unique<Robot>(cfg, model, 1);
    data = make_data(model);
    world = {.id = 0, .model = model, .data = data.get()};
  }
  void start(const Pose& base = {}, std::uint64_t seed = 7) {
    mj_resetData(model, data.get());
    Rng rng(seed, 0, 0, 0);
    robot->write_start(state_row(data.get()), base, rng);
    mj_forward(model, data.get());
    robot->reset(world);
  }
  // Runs one policy step: command, controls and physics at their periods.
  void play(const Action& action) {
    robot->command(world, action);
    const int controls = cfg.policy_dt_ms / cfg.ctrl_dt_ms,
              substeps = cfg.ctrl_dt_ms / cfg.sim_dt_ms;
    robot->write_ctrl(world, state_row(data.get()), nullptr);
    for (int k = 0; k < controls; ++k) {
      if (k > 0 && robot->controls_every_step()) robot->control(world, k);
      for (int i = 0; i < substeps; ++i) mj_step(model, data.get());
    }
    mj_forward(model, data.get());
  }

  RobotCfg cfg;
  std::unique_ptr<scene::Scene> scene;
  const mjModel* model = nullptr;
  std::unique_ptr<Robot> robot;
  DataPtr data;
  World world;
};

}  // namespace mjsense::tasks::robots
