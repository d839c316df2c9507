// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pick up an object and put it in or on a receptacle, or next to another object. Success: it is carried there by what it
// is to be on, the robot has let go, and that has hardly moved.

#include <array>
#include <string>
#include <vector>

#include "mjsense/episode/grasp_scene.h"
#include "mjsense/scenes/scene_task.h"
#include "mjsense/scenes/standing.h"

namespace mjsense {

// In or on any receptacle; next to any object; on the one of several alike that has a colour; into a box.
enum class PlaceKind { kInOrOn, kNextTo, kColor, kPacking };

class PickAndPlaceTask final : public SceneTask, public GraspScene, public PlaceScene {
 public:
  static constexpr std::string_view kObject = "pickup_obj", kReceptacle = "place_receptacle";

  // In cfg.scene; by default on a table with tableware.
  PickAndPlaceTask(PlaceKind kind, TaskCfg cfg);
  // pick_and_place, pick_and_place_next_to, pick_and_place_color, packing.
  std::string_view name() const override;
  std::string_view type() const override { return name(); }

  // An object inside something, or one that already stands next to what it is to be put next to.
  std::string start_fault(const World& world) const override;
  void begin(const World& world) override;
  // Reward: exp(-d), d (m) from the object to the middle of the receptacle's box.
  Evaluation evaluate(const World& world) const override;
  bool info_follows_evaluation() const override { return true; }

  std::span<const TaskObject> objects(int world) const override { return episodes_[world].objects; }
  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  Pose start_pose(int world, std::string_view role) const override;
  // Of the object: 3 cm above its start. The receptacle is to stay.
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  // carry_forward_pos_diff (m), carry_forward_rot_diff (rad), episode_step, position_error (m),
  // receptacle_pos_displacement (m, in its frame at the start), receptacle_rot_displacement (rad),
  // receptacle_tilt_displacement (rad), robot_contact, success, supported_by_carry_forward,
  // supported_by_receptacle.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;

  const GraspScene* grasp_scene() const override { return this; }
  std::span<const GraspObject> all_objects() const override { return objects_; }
  const ObjectShape& shape(int world, int object) const override {
    return scene().shape(world, object);
  }
  int target(int world) const override { return episodes_[world].target; }
  double support_height(int world) const override { return scene().support_height(world); }
  const PlaceScene* place_scene() const override { return this; }
  int receptacle(int world) const override { return episodes_[world].objects[1].body; }
  void places(const World& world, const Quat& turn, std::vector<Vec3>& out) const override;

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const StateRow& state) override;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  // What an observation shows.
  struct Judgement {
    int step = -1;  // of the episode
    bool supported = false, carried_forward = false, robot_contact = false;
    std::string_view lacks;             // of a success
    double pos_diff = 0, rot_diff = 0;  // to the nearest earlier supported pose
    double position_error = 0;
    Vec3 moved;  // of the receptacle
    double turned = 0, tilted = 0;
  };
  struct Episode {
    int target = 0, receptacle = 0;  // indices in objects_
    std::array<TaskObject, 2> objects;
    Pose start, receptacle_start;
    std::vector<Pose> supported;  // X_RO of all earlier supported observations
    Judgement judgement;
  };
  const Judgement& judge_now(const World& world) const;
  static std::string_view lacks_within(const Judgement& now);
  std::string_view lacks_beside(const World& world, const Judgement& now) const;
  std::vector<int> choose(int world, Rng& rng) const;
  std::string place_text(int world) const;
  Referrals::value_type referral(const char* key, int object) const;

  PlaceKind kind_;
  Standing standing_;
  std::vector<GraspObject> objects_;
  mutable std::vector<Episode> episodes_;  // [B]; a judgement is made once an observation
  int robot_root_ = -1;
};

}  // namespace mjsense
