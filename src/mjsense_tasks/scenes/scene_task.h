// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base of tasks that use a scene file: cfg.scene, or the task's default scene.

#include <memory>
#include <string>
#include <string_view>

#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {

class SceneTask : public episode::Task {
 public:
  // Throws the errors of task_scene().
  SceneTask(episode::TaskCfg cfg, std::string_view own_scene);
  scene::SceneCfg scene_cfg() const override { return scene_.scene_cfg(robot_entity()); }
  void bind(const std::shared_ptr<sim::Simulation>& simulation) override;
  std::string start_error(const World& world) const override { return scene_.fault(world); }
  std::string light(int world) const override;
  std::vector<int> absentees() const override { return scene_.absentees(); }
  bool present(int world, int body) const override { return scene_.body_present(world, body); }

 protected:
  EpisodeScene& scene() { return scene_; }
  const EpisodeScene& scene() const { return scene_; }
  // Overriding functions must call it first.
  void initialize_task() override;
  // Varies the scene for the episode that this world starts, before the scene is sampled.
  void vary_scene(int world);
  // Worlds::model_of(), or the compiled model if there are no worlds.
  mjModel world_model(int world) const;
  // Calls EpisodeScene::adopt() for this world's episode.
  std::vector<int> adopt_scene(int world, const robots::StateRow& state);
  // Prefix of error messages: "task 'pick': scene 'table'".
  std::string context() const;

 private:
  EpisodeScene scene_;
  std::weak_ptr<sim::Simulation> simulation_;
};

}  // namespace mjsense::tasks::scenes
