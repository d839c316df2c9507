// SPDX-License-Identifier: Apache-2.0
#pragma once
// The five `actions/*` sensors of an observation. Row t describes the action between observations
// t-1 and t.

#include <memory>
#include <vector>

#include "mjsense/observe/suite.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/rollout/action_log.h"

namespace mjsense::tasks::rollout {

// Streams `<sensor>/<group>` and `<sensor>/given/<group>` (bool []). `given` is false if the group
// has no action at this observation; its values are then 0. Units are those of each group's
// actuators (MoveGroup::command_unit: rad for the servos of an arm, 0 open .. 255 closed for a
// gripper), and m and wxyz for poses. X_BL is the pose of a group's leaf frame in the robot's base
// frame, and "before" is the observation that the action answers. At a terminal observation only
// commanded_action is given.
//
//   actions/commanded_action  float32, the command that the policy gave to the group's
//                             controller; none at the first observation. `success` [1] is the
//                             policy's own verdict, 0 or 1
//   actions/joint_pos         float64, joint position targets of the controllers, without noise, of
//                             groups whose controller has such targets; the positions that they
//                             hold at the first observation
//   actions/joint_pos_rel     float64, these targets minus qpos before, only of groups with as many
//                             targets as joints; zeros of every group at the first observation
//   actions/ee_twist          float64 [6], log6(inv(X_BL before) * fk(targets)) = [linear 3 (m),
//                             angular 3 (rad)], in the axes of that leaf frame, per control step;
//                             zeros at the first observation
//   actions/ee_pose           float64 [7], fk(targets), X_BL of every group; identity for a base
//
// The sensors refer to the task and the log, which must outlive them.
std::vector<std::shared_ptr<Sensor>> action_sensors(const episode::Task& task,
                                                    const ActionLog& log);

// Clears the rows of this world that have no meaning at a terminal observation. This happens after
// the sensors were computed, because the evaluation follows them. `first`: no action has been taken
// yet.
void blank_actions(observe::SensorSuite& suite, int world, bool first);

}  // namespace mjsense::tasks::rollout
