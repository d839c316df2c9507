// SPDX-License-Identifier: Apache-2.0
#pragma once
// Drive to an object: success while the head camera sees it from less than 1.5 m. The target is the only object
// of its kind in the episode, so that its text names it.

#include <string>
#include <vector>

#include "mjsense/scenes/base_route.h"
#include "mjsense/scenes/object_task.h"
#include "mjsense/tasks/nav_to_obj/sight.h"

namespace mjsense {

class NavToObjTask final : public ObjectTask {
 public:
  static constexpr std::string_view kRole = "pickup_obj";
  static constexpr double kReach = 1.5;    // m, of reward
  static constexpr double kNearby = 1.45;  // m, at most, of a place to drive to

  // In cfg.scene; by default on a floor of several rooms.
  explicit NavToObjTask(TaskCfg cfg);
  std::string_view name() const override { return "nav_to_obj"; }
  std::string_view type() const override { return "nav_to_obj"; }

  // Also: several objects have the target's text, or the robot sees the target from no place that it can reach.
  std::string start_fault(const World& world) const override;
  // Reward: 1 - d / 1.5 m if the camera sees the target, else 0; success: reward > 0.
  Evaluation evaluate(const World& world) const override;

  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  // position_error (m, on the floor, to the target), success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;

  // For planners: distance (m) of the target from a point of the floor.
  double distance(const World& world, double x, double y) const;
  // Whether the camera would see the target from there, X_WC.
  bool sees(const World& world, const Pose& camera) const;
  Pose camera_pose(const World& world) const { return sight_.pose(world.data); }
  const BaseRoutes* routes() const { return routes_.get(); }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const StateRow& state) override;
  void choose_goal(int world, Rng& rng, const StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  struct Judgement {
    double distance = 0, reward = 0;
  };
  Judgement judgement(const World& world) const;
  void find_camera();
  void set_target(int world, int target);
  // Whether no other object of the episode has the same text.
  bool alone(int world, int index) const;
  std::optional<Pose> start_place(int world, const Pose& placed, const StateRow& state,
                                  Rng& rng) const;

  Sight sight_;
  std::vector<std::vector<Vec3>> points_;          // of each object, to look at
  std::unique_ptr<BaseRoutes> routes_;             // null: the base does not drive
  std::vector<std::pair<double, double>> places_;  // of the floor, where the robot may start
  std::vector<int> targets_;                       // [B], of the scene's objects
};

}  // namespace mjsense
