// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base of tasks that concern one object of a scene.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/scenes/scene_task.h"

namespace mjsense::tasks::scenes {

class ObjectTask : public SceneTask {
 public:
  // `role` is the role of the object and must outlive the task.
  ObjectTask(episode::TaskCfg cfg, std::string_view own_scene, std::string_view role)
      : SceneTask(std::move(cfg), own_scene), role_(role) {}
  void begin(const World& world) override;
  std::span<const episode::TaskObject> objects(int world) const override {
    return {&subjects_[world].object, 1};
  }
  Pose start_pose(int world, std::string_view role) const override;
  std::optional<Pose> goal_pose(int /*world*/, std::string_view /*role*/) const override {
    return {};
  }

 protected:
  // Sets each world's object until an episode selects another. `name`: name in instructions.
  void begin_with(int body, const std::string& name, bool thin = false);
  void set_object(int world, int body, const std::string& name);
  const episode::TaskObject& object(int world) const { return subjects_[world].object; }
  // Sensors obj_start, grasp_state_<role>, and obj_end, the object's goal pose. `goal`: description.
  std::vector<std::shared_ptr<Sensor>> object_sensors(std::string goal) const;
  // Pose of the object at the first observation.
  const Pose& start(int world) const { return subjects_[world].start; }

 private:
  struct Subject {
    episode::TaskObject object;
    Pose start;
  };
  std::string_view role_;
  std::vector<Subject> subjects_;  // [B]
};

}  // namespace mjsense::tasks::scenes
