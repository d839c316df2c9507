// SPDX-License-Identifier: Apache-2.0
#pragma once
// How an arm takes a handle and moves it along: joint positions all the way, free of collisions, by
// MuJoCo on data of its own. The task asks where a base can stand; the planner follows.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/robots/robot.h"
#include "mjsense/tasks/opening/articulation.h"
#include "mjsense/tasks/opening/drive.h"
#include "mjsense/tasks/opening/handle_grasps.h"
#include "mjsense/worlds/scratch_data.h"

namespace mjsense {

// One way to do it, of one arm or of a hand that floats, which goes on screws.
struct HandleWay {
  ArmAndHand hand;
  Pose grasp;                      // X_WT
  Pose on_body;                    // the same in the frame of the handle's body
  std::vector<Pose> there;         // X_WT of a hand that floats, from the start to the pregrasp
  Pose end;                        // X_WT with the handle at the end of its way
  std::vector<RobotValues> go;     // joint positions from the start to the pregrasp, at least two
  std::vector<RobotValues> along;  // with the handle; the first is where it is now
  std::optional<Drive> drive;      // of the base meanwhile, whose places are in `along`
  Pose pregrasp;                   // X_BT
};

struct HandleReachCfg {
  double pregrasp = 0.04;    // m before the grasp, against the approach
  int points = 11;           // of the arc, ends included
  int drive_points = 17;     // likewise, where the base drives
  double room = 0.02;        // m, that a base keeps from everything while it drives
  double jump = 0.5;         // rad, of a joint from one point to the next
  double clearance = 0.010;  // m, of the robot to everything on the way there
  double contact = -0.001;   // m, what counts as touching while it has the handle
  double step = 0.10;        // rad, of any joint between two checks of the way
  double line_step = 0.02;   // m, of a hand that floats; a turn counts as on a radius of 0.2 m
  // m before the pregrasp: by way of such points it goes where the straight way is barred.
  std::array<double, 2> detours{0.12, 0.22};
};

class HandleReach {
 public:
  HandleReach(const mjModel* model, const Robot& robot, HandleReachCfg cfg = {});

  std::span<const ArmAndHand> hands() const { return hands_; }
  // A world from which ways are sought: its model, which differs from those of other worlds in where
  // furniture stands and how large things are, with margins about the robot; positions and mocap poses.
  // Valid as long as this and what the model was taken from.
  struct Start {
    mjModel model;
    std::vector<double> qpos, mocap_pos, mocap_quat;
  };
  Start start_of(const World& world) const;
  Start start_of(const mjModel& model, const StateRow& state) const;
  bool drives() const { return base_ >= 0; }
  int base() const { return base_; }  // group, -1: it stands where it is put
  // X_WB with the tool of a hand that floats at X_WT.
  Pose base_with(const ArmAndHand& hand, const Pose& tool) const;
  // The articulation goes from `from` to `to`, the robot standing as `start` says; with `driving` its
  // base drives meanwhile. Nothing: it cannot, or stands in something. At most `most_tries` grasps are
  // tried an arm.
  std::optional<HandleWay> find(const Start& start, const Articulation& one, double from, double to,
                                int most_tries, bool driving) const;
  // The rest of a way for an arm that has gone to its pregrasp, the handle being where it is now.
  std::optional<HandleWay> again(const Start& start, const Articulation& one, double from,
                                 double to, const HandleWay& before) const;
  // X_WB of the articulation's body, its joint at `q`.
  Pose body_pose(const Start& start, const Articulation& one, double q) const;
  // Whether the robot at the start is clear of everything, and of itself.
  bool stands_free(const Start& start) const;

 private:
  struct Seen;
  Seen see(mjData* data, const Start& start, const Articulation& one, double q) const;
  void set(mjData* data, const Start& start, const Articulation& one, double q) const;
  bool go_along(const Seen& seen, const HandleMotion& motion, RobotValues q, HandleWay& way) const;
  bool along_is_free(mjData* data, const Start& start, const HandleMotion& motion,
                     const HandleWay& way) const;
  bool try_grasp(mjData* data, const Start& start, const Seen& seen, const HandleMotion& motion,
                 bool driving, HandleWay& way) const;
  bool try_drives(mjData* data, const Start& start, const Seen& seen, const HandleMotion& motion,
                  const RobotValues& before, HandleWay& way) const;
  bool way_there(mjData* data, const Start& start, const Seen& seen, const RobotValues& before,
                 HandleWay& way) const;
  bool free(mjData* data, const Start& start, double clearance, const Articulation* held,
            const ArmAndHand* hand, bool driving = false) const;
  bool try_floating(mjData* data, const Start& start, const Pose& base, const HandleMotion& motion,
                    HandleWay& way) const;
  bool screw_is_free(mjData* data, const Start& start, const ArmAndHand& hand, const Pose& from,
                     const Pose& to) const;
  void float_to(mjData* data, const ArmAndHand& hand, const Pose& tool) const;
  void show(mjData* data, const RobotValues& values) const;
  bool way_is_free(mjData* data, const Start& start, int arm,
                   std::span<const RobotValues> way) const;
  mjModel with_margins(const mjModel& model) const;

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> own_;  // with margins about the robot
  const Robot& robot_;
  HandleReachCfg cfg_;
  int base_;
  std::vector<ArmAndHand> hands_;
  std::vector<char> of_robot_;   // [nbody]
  std::vector<char> fixed_;      // [nbody] of the robot, and no joint below the base moves it
  std::vector<int> of_gripper_;  // [nbody] group, -1
  std::vector<std::pair<int, int>> built_so_;  // geoms of the robot that touch at the start
  mutable ScratchData scratch_;
};

}  // namespace mjsense
