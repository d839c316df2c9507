// SPDX-License-Identifier: Apache-2.0
#pragma once
// The pick-and-place tasks: put an object in or on a receptacle, or next to another object.
// Success: the object is supported there, the robot has released it, and the receptacle has hardly
// moved.

#include <array>
#include <string>
#include <vector>

#include "mjsense_tasks/episode/grasp_scene.h"
#include "mjsense_tasks/scenes/base_placement_search.h"
#include "mjsense_tasks/scenes/scene_task.h"
#include "mjsense_tasks/tasks/pick_and_place/place_kind.h"

namespace mjsense::tasks {

class PickAndPlaceTask final : public scenes::SceneTask,
                               public episode::GraspScene,
                               public episode::PlaceScene {
 public:
  static constexpr std::string_view kObject = "pickup_obj", kReceptacle = "place_receptacle";

  // Plays in cfg.scene; the default scene is a table with tableware.
  PickAndPlaceTask(PlaceKind kind, episode::TaskCfg cfg);
  // pick_and_place, pick_and_place_next_to, pick_and_place_color, packing.
  std::string_view name() const override;
  std::string_view type() const override { return name(); }
  std::map<std::string, double> thresholds() const override;

  // Rejects starts in which an object penetrates another one, or in which the object is already
  // next to the other object (kNextTo).
  std::string start_error(const World& world) const override;
  void begin(const World& world) override;
  // Reward: exp(-d), with d the distance (m) from the object to the center of the receptacle's box.
  episode::Evaluation evaluate(const World& world) const override;
  bool info_follows_evaluation() const override { return true; }

  std::span<const episode::TaskObject> objects(int world) const override {
    return episodes_[world].objects;
  }
  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  Pose start_pose(int world, std::string_view role) const override;
  // Of the object: 3 cm above its start. The receptacle has no goal pose (nullopt).
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  // carry_forward_pos_diff (m), carry_forward_rot_diff (rad), episode_step, position_error (m),
  // receptacle_pos_displacement (m, in its frame at the start), receptacle_rot_displacement (rad),
  // receptacle_tilt_displacement (rad), robot_contact, success, supported_by_carry_forward,
  // supported_by_receptacle.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;

  const episode::GraspScene* grasp_scene() const override { return this; }
  std::span<const episode::GraspObject> all_objects() const override { return objects_; }
  const episode::ObjectShape& shape(int world, int object) const override {
    return scene().shape(world, object);
  }
  int target(int world) const override { return episodes_[world].target; }
  double support_height(int world) const override { return scene().support_height(world); }
  const episode::PlaceScene* place_scene() const override { return this; }
  int receptacle(int world) const override { return episodes_[world].objects[1].body; }
  void places(const World& world, const Quat& turn, std::vector<Vec3>& out) const override;

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  void adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  // Evaluation of one observation.
  struct Assessment {
    int step = -1;  // of the episode
    bool supported = false, carried_forward = false, robot_contact = false;
    std::string_view missing;           // unmet condition of success; "" if none
    double pos_diff = 0, rot_diff = 0;  // m, rad, to the nearest earlier supported pose
    double position_error = 0;
    Vec3 moved;  // displacement of the receptacle, m
    double turned = 0, tilted = 0;
  };
  struct Episode {
    int target = 0, receptacle = 0;  // indices in objects_
    std::array<episode::TaskObject, 2> objects;
    Pose start, receptacle_start;
    std::vector<Pose> supported;  // X_RO of all earlier supported observations
    Assessment assessment;
  };
  const Assessment& assess(const World& world) const;
  std::string_view missing_within(int world, const Assessment& now) const;
  // Maximum gap, displacement (m) and rotation (rad) with which an episode succeeds.
  double max_gap(int world) const;
  double max_moved(int world) const;
  double max_turned(int world) const;
  std::string_view missing_beside(const World& world, const Assessment& now) const;
  void set_objects(int world, int target, int receptacle);
  std::vector<int> choose(int world, Rng& rng) const;
  std::string place_description(int world) const;
  Referrals::value_type referral(const char* key, int object) const;

  PlaceKind kind_;
  scenes::BasePlacementSearch standing_;
  std::vector<episode::GraspObject> objects_;
  mutable std::vector<Episode> episodes_;  // [B]; evaluated once per observation
  int robot_root_ = -1;
};

}  // namespace mjsense::tasks
