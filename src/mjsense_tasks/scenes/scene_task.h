// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base of tasks that use a scene file: cfg.scene, or the task's default scene.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

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
  // The same for a given start. Returns the index of the object with each of these roles; throws
  // ValueError if the start does not have one, or if its body is none of scene().objects().
  std::vector<int> adopt_scene(int world, const episode::GivenStart& start,
                               std::span<const std::string_view> roles,
                               const robots::StateRow& state);
  // The body with a role in a given start. Throws ValueError.
  int body_of(const episode::GivenStart& start, std::string_view role) const;
  // Prefix of error messages: "task 'pick': scene 'table'".
  std::string context() const;

 private:
  EpisodeScene scene_;
  std::weak_ptr<sim::Simulation> simulation_;
};

}  // namespace mjsense::tasks::scenes
