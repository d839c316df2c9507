// SPDX-License-Identifier: Apache-2.0
#pragma once
// The door_opening task: push or pull a door open. The episode succeeds while the door is open by
// at least 67 % of its range.

#include <string>
#include <vector>

#include "mjsense_tasks/scenes/base_planner.h"
#include "mjsense_tasks/scenes/doors.h"
#include "mjsense_tasks/scenes/object_task.h"

namespace mjsense::tasks {

class DoorOpeningTask final : public scenes::ObjectTask {
 public:
  static constexpr std::string_view kRole = "door_handle";
  static constexpr double kOpen = 0.67;  // fraction of the range

  // Doors are found in cfg.scene (scenes/doors.h). The default scene has two rooms and one door.
  explicit DoorOpeningTask(episode::TaskCfg cfg);
  std::string_view name() const override { return "door_opening"; }
  std::string_view type() const override { return "door_open"; }
  std::map<std::string, double> thresholds() const override {
    return {{"door_openness_threshold", kOpen}};
  }

  void begin(const World& world) override;
  episode::Evaluation evaluate(const World& world) const override;  // reward: 1 on success, else 0

  std::string description(int world) const override;  // "Push the door open"
  Referrals referrals(int world) const override;
  // Writes handle_grasped, joint_position (opening fraction, not an angle) and success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;
  void edit_suite(observe::SensorSuite& suite) const override;

  // The door of this world's episode, its current opening fraction, and whether the robot started
  // on the side from which the door is pushed.
  const scenes::Door& door(int world) const { return doors_[episodes_[world].door]; }
  double fraction(const World& world) const {
    return door(world.id).fraction(world.model, world.data->qpos);
  }
  bool push(int world) const { return episodes_[world].push; }
  // Free base poses with all doors shut; null for a robot whose base cannot drive.
  const scenes::BasePlanner* routes() const { return routes_.get(); }
  // Occupancy of the floor without the doors.
  const scenes::OccupancyGrid& open_floor() const { return *open_floor_; }
  // Footprint of the robot without its arms.
  const scenes::Footprint& trunk() const { return *trunk_; }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  void choose_goal(int world, Rng& rng, const robots::StateRow& state) override;
  void adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  struct Side {
    Vec3 middle, direction;  // middle of the shut leaf; direction in which it starts to open
  };
  // Whether the door opens away from the robot.
  bool pushes(const World& world) const;
  struct Episode {
    int door = 0;
    bool push = true;
  };
  std::vector<scenes::Door> doors_;
  std::vector<Side> sides_;  // one per door
  std::unique_ptr<scenes::OccupancyGrid> floor_, open_floor_;
  std::unique_ptr<scenes::Footprint> footprint_, trunk_;
  std::unique_ptr<scenes::BasePlanner> routes_;
  std::vector<Episode> episodes_;  // [B]
};

// The `door_state` sensor, JSON. 1-element lists: joint_angle (rad), opening_percentage (fraction,
// 0 to 1), is_open. handle_position and door_position (anchor of the hinge): m, world frame.
// handle_extents: edge lengths in m of the box around the handle's first visible geom, in that
// geom's frame. All values belong to the current state.
std::shared_ptr<Sensor> door_state_sensor(const DoorOpeningTask& task);

}  // namespace mjsense::tasks
