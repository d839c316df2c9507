// SPDX-License-Identifier: Apache-2.0
#pragma once
// A robot of a compiled model: move groups, controllers, kinematics. State is per world, in arrays
// indexed by world; every function that takes a World (or a world index) touches that world's alone
// and may run in parallel with the others.

#include <mujoco/mujoco.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense/observe/image_points.h"
#include "mjsense/observe/joint_state.h"
#include "mjsense/robots/action.h"
#include "mjsense/robots/base_placement.h"
#include "mjsense/robots/controllers/controller.h"
#include "mjsense/robots/kinematics.h"
#include "mjsense/robots/move_group.h"
#include "mjsense/robots/robot_cfg.h"
#include "mjsense/robots/state_row.h"

namespace mjsense {

class Robot {
 public:
  static constexpr std::string_view kPrefix = "robot_0/";

  // Resolves every name of cfg; throws KeyError naming the first that `model` does not have.
  Robot(RobotCfg cfg, const mjModel* model, int num_worlds, std::string_view prefix = kPrefix,
        std::optional<ControlPeriods> periods = {});

  const RobotCfg& cfg() const { return cfg_; }
  const std::string& name() const { return cfg_.name; }
  const std::string& prefix() const { return prefix_; }
  std::span<const MoveGroup> groups() const { return groups_; }
  int group_index(std::string_view name) const;  // throws KeyError
  const MoveGroup& group(std::string_view name) const { return groups_[group_index(name)]; }
  int arm() const { return arm_; }          // index of the first arm, -1: it has none
  int gripper() const { return gripper_; }  // index of the first gripper, -1: it has none
  int base_body() const { return base_body_; }

  // --- what a fresh world shows
  Pose base_pose(const World& world) const;                    // X_WB: on the floor
  Pose leaf_pose(const World& world, int group) const;         // X_WL
  Pose tcp_pose(const World& world, int group) const;          // X_BL = inv(base) leaf
  double opening(const World& world, int gripper) const;       // m, between the pads
  bool is_open(const World& world, int gripper) const;         // above half of max_opening
  void read_qpos(const World& world, RobotValues& out) const;  // every group

  // --- kinematics, in the base frame
  // Leaf of `group` where each joint stands at its group's value; a group with fewer values than
  // joints (a gripper's one command for two drivers) gives all of them its first. A base gives the
  // identity.
  Pose fk(int group, const RobotValues& values) const;
  // From the base to the group's leaf, through every joint of a move group on the way. Not for a
  // base, which has none.
  const Chain& chain(int group) const { return *chains_[group]; }
  // Moves the joints of `group` alone until its leaf is at `target` (base frame); the other groups
  // stand as `values` says (in: the start, out: the solution). False, and `values` as they were, if
  // it is not reached. For a path: max_iterations = Chain::kTracking stays near the start.
  bool ik(int group, const Pose& target, RobotValues& values, int max_iterations = 1000) const;
  // X_BL where the controllers' targets put the leaf; joints without a target stay where they are.
  Pose target_pose(const World& world, int group) const;

  // --- controllers
  const Controller& controller(int group) const { return *controllers_[group]; }
  // Start configuration with noise drawn from rng, robot standing at X_WB, or where it stands;
  // controls hold it. Throws ValueError where nothing can carry the base there.
  void write_start(const StateRow& state, const std::optional<Pose>& base, Rng& rng) const;
  // Its two parts: where the joints are, and all else.
  void write_joints(const StateRow& state, Rng& rng) const;
  void stand(const StateRow& state, const std::optional<Pose>& base) const;
  // From now on it starts stooped: cfg().groups[i].init is what `stooped` says, where it says
  // something. Whether there is such a group.
  bool stoop();
  // A new episode: the targets are what the controllers hold now (arm: its qpos; gripper: open or
  // closed as it is).
  void reset(const World& world);
  // New targets: what the controllers make of the action; groups that it leaves out hold. Throws
  // ValueError when a group has the wrong number of values.
  void command(const World& world, const Action& action);
  // Commands of all controlled groups in a row: what the action has and, of a group that it leaves
  // out, what leaves that as it is. In a fresh world.
  std::vector<double> commands(const World& world, const Action& action) const;
  // Controls of the first control step, with noise on the targets if rng is not null.
  void write_ctrl(const World& world, const StateRow& state, Rng* noise) const;
  // Control step `index` (from 1) after that, in the pass over the worlds; only where a controller
  // has something to do there. Returns the last of MuJoCo's stages that stays valid.
  bool controls_every_step() const { return every_step_; }
  mjtStage control(const World& world, int index) const;
  // Un-noised targets of the groups whose controllers aim at positions: what actions/joint_pos
  // records.
  const RobotValues& targets(int world) const { return targets_[world]; }

  // Sensors that every task with this robot records (tcp_pose). They refer to this robot.
  std::vector<std::shared_ptr<Sensor>> create_robot_sensors() const;
  // Its parts that object_image_points shows in pictures: the grippers.
  std::vector<ImagePointsSensor::Object> image_objects() const;
  std::vector<JointGroup> joint_groups() const;

 private:
  std::span<double> holding(int world, int group);
  void add_arm_noise(const World& world, int group, Rng& rng, std::span<double> q) const;

  RobotCfg cfg_;
  const mjModel* model_;
  std::string prefix_;
  std::vector<MoveGroup> groups_;
  std::vector<std::unique_ptr<Controller>> controllers_;  // per group
  std::vector<std::unique_ptr<Chain>> chains_;            // per group, null without a leaf
  // Per group, per joint of its chain: (group, index) of its value.
  std::vector<std::vector<std::pair<int, int>>> source_;
  int arm_ = -1, gripper_ = -1, base_body_ = -1;
  bool every_step_ = false;
  BasePlacement placement_;
  std::vector<RobotValues> targets_;  // [B]; `given` false: the group holds
};

}  // namespace mjsense
