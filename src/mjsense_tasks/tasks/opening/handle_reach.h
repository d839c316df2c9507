// SPDX-License-Identifier: Apache-2.0
#pragma once
// Collision-free arm motions that grasp a handle and move its articulation, as joint positions
// along the whole path. Collisions are checked by MuJoCo on separate mjData. The task uses this to
// find base placements; the planner executes the path.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/rng.h"
#include "mjsense/worlds/scratch_data.h"
#include "mjsense_tasks/robots/allowed_contact.h"
#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/tasks/opening/articulation.h"
#include "mjsense_tasks/tasks/opening/base_motion.h"
#include "mjsense_tasks/tasks/opening/handle_grasps.h"

namespace mjsense::tasks {

// A path for one arm, or for a floating gripper, which moves on screws.
struct HandlePath {
  OrientedHand hand;
  Pose grasp;                  // X_WT
  Pose on_body;                // the grasp in the frame of the handle's body
  std::vector<Pose> approach;  // X_WT of a floating gripper from the start to the pregrasp
  Pose end;                    // X_WT with the handle at the end of its motion
  std::vector<robots::RobotValues>
      approach_joints;  // joint positions from the start to the pregrasp, at least two
  std::vector<robots::RobotValues>
      motion_joints;           // while holding the handle; the first is at its current pose
  std::optional<Drive> drive;  // of the base, whose poses are part of `motion_joints`
  Pose pregrasp;               // X_BT
};

struct HandleReachCfg {
  double pregrasp = 0.04;    // m before the grasp, against the approach
  int points = 11;           // along the handle's path, ends included
  int drive_points = 17;     // the same, if the base drives
  double room = 0.02;        // m, clearance of a driving base
  double jump = 0.5;         // rad, maximum change of a joint between two points
  double clearance = 0.010;  // m, clearance of the robot on the path to the pregrasp
  double contact = -0.001;   // m, contact distance below which a contact counts while holding
  double step = 0.10;        // rad, maximum change of a joint between two collision checks
  double line_step = 0.02;   // m, the same for a floating gripper; 1 rad counts as 0.2 m
  // m behind the pregrasp: via points that are tried if the straight path is blocked.
  std::array<double, 2> detours{0.12, 0.22};
};

class HandleReach {
 public:
  HandleReach(const mjModel* model, const robots::Robot& robot, HandleReachCfg cfg = {});

  std::span<const OrientedHand> hands() const { return hands_; }
  // The state of a world in which paths are searched: its model with collision margins around the
  // robot, its positions and mocap poses. Models differ between worlds in furniture poses and
  // object sizes. The HandleReach and the source of the model must outlive it.
  struct Start {
    mjModel model;
    std::vector<double> qpos, mocap_pos, mocap_quat;
  };
  Start start_of(const World& world) const;
  Start start_of(const mjModel& model, const robots::StateRow& state) const;
  bool drives() const { return base_ >= 0; }
  int base() const { return base_; }  // move group; -1: the base cannot move
  // X_WB of a floating gripper whose tool is at X_WT.
  Pose base_with(const OrientedHand& hand, const Pose& tool) const;
  // A path that moves the articulation from `from` to `to` with the robot as in `start`. With
  // `driving`, the base drives during the motion. Returns nullopt if there is no path or if the
  // robot is in collision at the start. At most `max_tries` grasps are tried per arm.
  std::optional<HandlePath> find(const Start& start, const Articulation& one, double from,
                                 double to, int max_tries, bool driving) const;
  // The rest of the path `before` for an arm at its pregrasp, recomputed for the handle's current
  // pose.
  std::optional<HandlePath> again(const Start& start, const Articulation& one, double from,
                                  double to, const HandlePath& before) const;
  // X_WB of the articulation's body, its joint at `q`.
  Pose body_pose(const Start& start, const Articulation& one, double q) const;
  // Whether the robot at the start is free of collisions with the scene and with itself.
  bool is_collision_free(const Start& start) const;

 private:
  struct Geometry;
  Geometry measure(mjData* data, const Start& start, const Articulation& one, double q) const;
  void write_state(mjData* data, const Start& start, const Articulation& one, double q) const;
  bool follow_handle(const Geometry& at_start, const HandleMotion& motion, robots::RobotValues q,
                     HandlePath& path) const;
  bool motion_is_free(mjData* data, const Start& start, const HandleMotion& motion,
                      const HandlePath& path) const;
  bool try_grasp(mjData* data, const Start& start, const Geometry& at_start,
                 const HandleMotion& motion, bool driving, HandlePath& path) const;
  bool try_drives(mjData* data, const Start& start, const Geometry& at_start,
                  const HandleMotion& motion, const robots::RobotValues& before,
                  HandlePath& path) const;
  bool approach_path(mjData* data, const Start& start, const Geometry& at_start,
                     const robots::RobotValues& before, HandlePath& path) const;
  bool free(mjData* data, const Start& start, double clearance,
            const robots::AllowedContact& allowed = {}, bool driving = false) const;
  robots::AllowedContact grasp_of(const OrientedHand& hand, const Articulation& one) const;
  bool try_floating(mjData* data, const Start& start, const Pose& base, const HandleMotion& motion,
                    HandlePath& path) const;
  bool screw_is_free(mjData* data, const Start& start, const OrientedHand& hand, const Pose& from,
                     const Pose& to) const;
  void float_to(mjData* data, const OrientedHand& hand, const Pose& tool) const;
  void write_joints(mjData* data, const robots::RobotValues& values) const;
  bool path_is_free(mjData* data, const Start& start, int arm,
                    std::span<const robots::RobotValues> path) const;
  mjModel with_margins(const mjModel& model) const;

  ModelPtr own_;  // with margins about the robot
  const robots::Robot& robot_;
  HandleReachCfg cfg_;
  int base_;
  std::vector<OrientedHand> hands_;
  std::vector<char> of_robot_;  // [nbody]
  std::vector<char> fixed_;     // [nbody] bodies of the robot that are rigidly attached to its base
  std::vector<int> of_gripper_;  // [nbody] move group of the gripper, or -1
  std::vector<std::pair<int, int>>
      initial_contacts_;  // geoms of the robot in contact at the initial pose, exempt
  mutable worlds::ScratchData scratch_;
};

}  // namespace mjsense::tasks
