// SPDX-License-Identifier: Apache-2.0
#pragma once
// Open a door, by pushing or pulling: success while it is open by two thirds of its range.

#include <string>
#include <vector>

#include "mjsense/scenes/base_route.h"
#include "mjsense/scenes/doors.h"
#include "mjsense/scenes/object_task.h"

namespace mjsense {

class DoorOpeningTask final : public ObjectTask {
 public:
  static constexpr std::string_view kRole = "door_handle";
  static constexpr double kOpen = 0.67;  // fraction of the range

  // In cfg.scene, in which a door is found (scenes/doors.h); by default two rooms with one.
  explicit DoorOpeningTask(TaskCfg cfg);
  std::string_view name() const override { return "door_opening"; }
  std::string_view type() const override { return "door_open"; }

  void begin(const World& world) override;
  Evaluation evaluate(const World& world) const override;  // reward: 1 while it succeeds

  std::string description(int world) const override;  // "Push the door open"
  Referrals referrals(int world) const override;
  // handle_grasped, joint_position (the fraction), success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;
  void edit_suite(SensorSuite& suite) const override;

  // The door of this world's episode, how far it is open now, and whether the robot started on the
  // side from which it is pushed.
  const Door& door(int world) const { return doors_[episodes_[world].door]; }
  double fraction(const World& world) const {
    return door(world.id).fraction(world.model, world.data->qpos);
  }
  bool push(int world) const { return episodes_[world].push; }
  // Where the base may drive while the doors are shut; null for a robot whose base does not move.
  const BaseRoutes* routes() const { return routes_.get(); }
  // The floor where the doors were not.
  const Occupancy& open_floor() const { return *open_floor_; }
  // What the robot takes of it without its arms.
  const Footprint& trunk() const { return *trunk_; }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const StateRow& state) override;
  void choose_goal(int world, Rng& rng, const StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  struct Side {
    Vec3 middle, way;  // of the leaf when shut; the way it begins to open
  };
  struct Episode {
    int door = 0;
    bool push = true;
  };
  std::vector<Door> doors_;
  std::vector<Side> sides_;  // of each door
  std::unique_ptr<Occupancy> floor_, open_floor_;
  std::unique_ptr<Footprint> footprint_, trunk_;
  std::unique_ptr<BaseRoutes> routes_;
  std::vector<Episode> episodes_;  // [B]
};

// `door_state`, JSON, 1-element lists: joint_angle (rad), opening_percentage (fraction 0 .. 1), is_open;
// handle_position and door_position (the hinge's anchor), m, world; handle_extents (m): edges of the
// box around the handle's first geom that is seen, in the geom's frame. All of this very state.
std::shared_ptr<Sensor> door_state_sensor(const DoorOpeningTask& task);

}  // namespace mjsense
