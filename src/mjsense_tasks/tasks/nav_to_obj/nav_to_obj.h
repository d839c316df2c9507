// SPDX-License-Identifier: Apache-2.0
#pragma once
// The nav_to_obj task: drive to an object. The episode succeeds while the head camera sees the
// target from less than 1.5 m. The target is the only object with its text in the episode, so the
// text identifies it.

#include <string>
#include <vector>

#include "mjsense_tasks/scenes/base_planner.h"
#include "mjsense_tasks/scenes/object_task.h"
#include "mjsense_tasks/tasks/nav_to_obj/line_of_sight.h"

namespace mjsense::tasks {

class NavToObjTask final : public scenes::ObjectTask {
 public:
  static constexpr std::string_view kRole = "pickup_obj";
  static constexpr double kReach = 1.5;  // m, distance at which the reward becomes 0
  static constexpr double kNearby =
      1.45;  // m, maximum distance of a planner's goal from the target

  // Plays in cfg.scene; the default scene is a floor with several rooms.
  explicit NavToObjTask(episode::TaskCfg cfg);
  std::string_view name() const override { return "nav_to_obj"; }
  std::string_view type() const override { return "nav_to_obj"; }

  // Selects only objects that can be picked up and to which a path leads that ends this close. [m]
  void require_graspable_within(double distance) {
    graspable_ = true;
    arrived_ = distance;
  }

  // Also rejects starts in which several objects have the target's text, or in which the target is
  // not visible from any base pose that the robot can drive to.
  std::string start_error(const World& world) const override;
  // Reward: 1 - d / 1.5 m if the camera sees the target, else 0; success: reward > 0.
  episode::Evaluation evaluate(const World& world) const override;

  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  // Writes position_error (m, horizontal distance to the target) and success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;

  // For planners: horizontal distance (m) of the target from a point on the floor.
  double distance(const World& world, double x, double y) const;
  // Whether the target is visible from the camera pose X_WC.
  bool sees(const World& world, const Pose& camera) const;
  Pose camera_pose(const World& world) const { return line_of_sight_.pose(world.data); }
  const scenes::BasePlanner* routes() const { return routes_.get(); }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  void choose_goal(int world, Rng& rng, const robots::StateRow& state) override;
  void adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  struct Assessment {
    double distance = 0, reward = 0;
  };
  Assessment assessment(const World& world) const;
  void find_camera();
  void set_target(int world, int target);
  // Whether the text of this object is unique among the objects of the episode.
  bool alone(int world, int index) const;
  std::optional<Pose> start_place(int world, const Pose& placed, const robots::StateRow& state,
                                  Rng& rng) const;

  bool graspable_ = false;  // targets are objects that can be picked up
  double arrived_ = 1.35;   // m, a start is playable if a path ends this close to the target
  LineOfSight line_of_sight_;
  std::vector<std::vector<Vec3>> points_;          // surface points of each object, body frame
  std::unique_ptr<scenes::BasePlanner> routes_;    // null if the base cannot drive
  std::vector<std::pair<double, double>> places_;  // possible start positions on the floor, m
  std::vector<int> targets_;                       // [B], index of a scene object
};

}  // namespace mjsense::tasks
