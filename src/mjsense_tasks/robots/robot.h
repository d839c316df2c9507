// SPDX-License-Identifier: Apache-2.0
#pragma once
// A robot of a compiled model: move groups, controllers, kinematics. State is stored per world. A
// function that takes a World (or a world index) accesses the state of that world only and may run
// in parallel with calls for other worlds.

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
#include "mjsense_tasks/robots/action.h"
#include "mjsense_tasks/robots/base_placement.h"
#include "mjsense_tasks/robots/controllers/controller.h"
#include "mjsense_tasks/robots/kinematics.h"
#include "mjsense_tasks/robots/move_group.h"
#include "mjsense_tasks/robots/robot_cfg.h"
#include "mjsense_tasks/robots/state_row.h"

namespace mjsense::tasks::robots {

class Robot {
 public:
  static constexpr std::string_view kPrefix = "robot_0/";

  // Resolves every name of cfg. Throws KeyError that names the first one that `model` lacks.
  Robot(RobotCfg cfg, const mjModel* model, int num_worlds, std::string_view prefix = kPrefix,
        std::optional<ControlPeriods> periods = {});

  const RobotCfg& cfg() const { return cfg_; }
  const std::string& name() const { return cfg_.name; }
  const std::string& prefix() const { return prefix_; }
  std::span<const MoveGroup> groups() const { return groups_; }
  int group_index(std::string_view name) const;  // throws KeyError
  const MoveGroup& group(std::string_view name) const { return groups_[group_index(name)]; }
  int arm() const { return arm_; }          // index of the first arm; -1: no arm
  int gripper() const { return gripper_; }  // index of the first gripper; -1: no gripper
  int base_body() const { return base_body_; }

  // --- measurements; the derived fields of the world must be current (mj_forward)
  Pose base_pose(const World& world) const;               // X_WB; the base frame is on the floor
  Pose leaf_pose(const World& world, int group) const;    // X_WL
  Pose tcp_pose(const World& world, int group) const;     // X_BL = X_WB^-1 X_WL
  double opening(const World& world, int gripper) const;  // distance between the pads, m
  bool is_open(const World& world, int gripper) const;    // opening is above half of max_opening
  void read_qpos(const World& world, RobotValues& out) const;  // joint positions of all groups

  // --- kinematics, in the base frame
  // X_BL of `group` for the given joint positions. If a group has fewer values than joints (one
  // command for the two driver joints of a gripper), all of its joints take the first value. The
  // identity for a base.
  Pose fk(int group, const RobotValues& values) const;
  // The chain from the base to the group's leaf. It contains every joint of a move group on this
  // path. Undefined for a base, which has no chain.
  const Chain& chain(int group) const { return *chains_[group]; }
  // Inverse kinematics: moves the joints of `group` only, until its leaf is at `target` (base
  // frame). The other groups keep their positions in `values` (in: the start, out: the solution).
  // Returns false and leaves `values` unchanged if the target is not reached. With max_iterations =
  // Chain::kTracking the solution stays near the start, as a path needs it.
  bool ik(int group, const Pose& target, RobotValues& values, int max_iterations = 1000) const;
  // X_BL at the controllers' targets; joints without a target use their measured positions.
  Pose target_pose(const World& world, int group) const;

  // --- controllers
  const Controller& controller(int group) const { return *controllers_[group]; }
  // Writes the start configuration with noise from rng, the base at X_WB (unchanged if empty), and
  // controls that hold it. Throws ValueError if the base cannot be put there.
  void write_start(const StateRow& state, const std::optional<Pose>& base, Rng& rng) const;
  // The two parts of write_start(): the joint positions; and the base placement with the controls.
  void write_joints(const StateRow& state, Rng& rng) const;
  void stand(const StateRow& state, const std::optional<Pose>& base) const;
  // Writes the joint positions of one group, at rest. Throws KeyError, ValueError.
  void write_group(const StateRow& state, std::string_view group,
                   std::span<const double> positions) const;
  // Replaces the start positions of every group that has `low_init` positions by these, for all
  // later starts. Returns whether there is such a group.
  bool lower_torso();
  // Starts an episode: the targets become what the controllers hold now (arm: its qpos; gripper:
  // its open or closed command, whichever is nearer).
  void reset(const World& world);
  // Sets new targets from the action; groups without a command hold. Throws ValueError if a command
  // has the wrong number of values or is not finite.
  void command(const World& world, const Action& action);
  // Commands of all controlled groups, concatenated. For a group without a command in the action
  // this is the command that keeps it as it is. The derived fields of the world must be current.
  std::vector<double> commands(const World& world, const Action& action) const;
  // Writes the controls of the first control step of a policy step; adds noise to the targets if
  // `noise` is not null.
  void write_ctrl(const World& world, const StateRow& state, Rng* noise) const;
  // Writes the controls of control step `index` (1, 2, ...) of a policy step; called in the
  // parallel pass over the worlds, and only if controls_every_step(). Returns the last of MuJoCo's
  // stages that is still valid.
  bool controls_every_step() const { return every_step_; }
  mjtStage control(const World& world, int index) const;
  // Targets without noise, for groups with position targets. `actions/joint_pos` records them.
  const RobotValues& targets(int world) const { return targets_[world]; }

  // Sensors that every task with this robot records (tcp_pose). They refer to this robot, which
  // must outlive them.
  std::vector<std::shared_ptr<Sensor>> create_robot_sensors() const;
  // Parts of the robot that object_image_points includes: the grippers.
  std::vector<observe::ImagePointsSensor::Object> image_objects() const;
  std::vector<observe::JointGroup> joint_groups() const;

 private:
  std::span<double> holding(int world, int group);
  void add_arm_noise(const World& world, int group, Rng& rng, std::span<double> q) const;

  RobotCfg cfg_;
  const mjModel* model_;
  std::string prefix_;
  std::vector<MoveGroup> groups_;
  std::vector<std::unique_ptr<Controller>> controllers_;  // per group
  std::vector<std::unique_ptr<Chain>> chains_;            // per group, null without a leaf site
  // [group][joint of its chain]: (group, index) of the joint's value in RobotValues.
  std::vector<std::vector<std::pair<int, int>>> source_;
  int arm_ = -1, gripper_ = -1, base_body_ = -1;
  bool every_step_ = false;
  BasePlacement placement_;
  std::vector<RobotValues> targets_;  // [B]; `given` is false while the group holds
};

}  // namespace mjsense::tasks::robots
