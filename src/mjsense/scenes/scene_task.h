// SPDX-License-Identifier: Apache-2.0
#pragma once
// A task that plays in a scene of data: cfg.scene, else one of its own.

#include <memory>
#include <string>
#include <string_view>

#include "mjsense/episode/task.h"
#include "mjsense/scenes/episode_scene.h"

namespace mjsense {

class SceneTask : public Task {
 public:
  // Throws as task_scene().
  SceneTask(TaskCfg cfg, std::string_view own_scene);
  SceneCfg scene_cfg() const override { return scene_.scene_cfg(robot_entity()); }
  void bind(const std::shared_ptr<Simulation>& simulation) override;
  std::string start_fault(const World& world) const override { return scene_.fault(world); }
  std::vector<int> absentees() const override { return scene_.absentees(); }
  bool present(int world, int body) const override { return scene_.body_present(world, body); }

 protected:
  EpisodeScene& scene() { return scene_; }
  const EpisodeScene& scene() const { return scene_; }
  // Those who override it call it first.
  void initialize_task() override;
  // What differs in the episode that this world begins, before the scene is sampled.
  void vary_scene(int world);
  // Worlds::model_of(); the model where there are no worlds.
  mjModel world_model(int world) const;
  // EpisodeScene::adopt(), of this world's episode.
  std::vector<int> adopt_scene(int world, const StateRow& state);
  // "task 'pick': scene 'table'", which errors begin with.
  std::string place() const;

 private:
  EpisodeScene scene_;
  std::weak_ptr<Simulation> simulation_;
};

}  // namespace mjsense
