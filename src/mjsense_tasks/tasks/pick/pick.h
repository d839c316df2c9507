// SPDX-License-Identifier: Apache-2.0
#pragma once
// The pick task: pick up one of the objects of a scene. Success: the object is at least 1 cm above
// its start, and the robot is the only body that touches it.

#include <array>
#include <string>
#include <vector>

#include "mjsense_tasks/episode/grasp_scene.h"
#include "mjsense_tasks/scenes/base_placement_search.h"
#include "mjsense_tasks/scenes/object_task.h"

namespace mjsense::tasks {

class PickTask final : public scenes::ObjectTask, public episode::GraspScene {
 public:
  static constexpr std::string_view kRole = "pickup_obj";

  // Plays in cfg.scene; the default scene is a table in a room.
  explicit PickTask(episode::TaskCfg cfg);
  std::string_view name() const override { return "pick"; }
  std::string_view type() const override { return "pick"; }
  std::map<std::string, double> thresholds() const override;

  // In a state that another task has sampled: makes this body the object of the episode. Throws
  // ValueError if it cannot be picked up.
  void choose_object(int world, int body, const robots::StateRow& state);

  // Reward: height above the start (m) while no other body supports the object.
  episode::Evaluation evaluate(const World& world) const override;

  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  std::optional<Pose> goal_pose(int world,
                                std::string_view role) const override;  // 5 cm above the start
  // Writes episode_step, position_error (m, to the goal), rotation_error (rad) and success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override {
    return object_sensors("Goal pose of the lifted object.");
  }

  const episode::GraspScene* grasp_scene() const override { return this; }
  std::span<const episode::GraspObject> all_objects() const override { return objects_; }
  const episode::ObjectShape& shape(int world, int object) const override {
    return scene().shape(world, object);
  }
  int target(int world) const override { return targets_[world]; }
  double support_height(int world) const override { return scene().support_height(world); }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  void choose_goal(int world, Rng& rng, const robots::StateRow& state) override;
  void adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  void set_target(int world, int target);
  bool supported_by_others(const World& world, int body) const;
  std::string_view missing(const World& world) const;

  scenes::BasePlacementSearch standing_;
  std::vector<episode::GraspObject> objects_;
  std::vector<int> things_;   // indices in objects_ of possible targets
  std::vector<int> targets_;  // [B], index in objects_
  int robot_root_ = -1;
};

}  // namespace mjsense::tasks
