// SPDX-License-Identifier: Apache-2.0
#pragma once
// The five `actions/*` of an observation: what led to it. Row t belongs to the action between
// observations t-1 and t.

#include <memory>
#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/observe/suite.h"
#include "mjsense/rollout/action_log.h"

namespace mjsense {

// Streams `<sensor>/<group>` and `<sensor>/given/<group>` (bool []: false where the group has no
// action at this observation; its numbers are 0 then). Units: what each group's actuators
// take (MoveGroup::command_unit: rad of an arm's servos, 0 open .. 255 closed of a gripper), m and
// wxyz (poses). "Before" is the observation that the action answers. At a
// terminal observation nothing is given but commanded_action.
//
//   actions/commanded_action  float32, as the policy gave it to the group's controller; first: nothing. `success` [1] is the
//                             policy's own verdict, 0 or 1
//   actions/joint_pos         float64, the joint positions that the controllers aim at, without
//                             noise, of groups whose controller aims at some; first: what they hold
//   actions/joint_pos_rel     float64, these minus qpos before; only of groups that have as many
//                             targets as joints; first: zeros of every group
//   actions/ee_twist          float64 [6], log6(inv(X_BL before) * fk(targets)) = [linear 3 (m),
//                             angular 3 (rad)], in the axes of that leaf, per control step; first:
//                             zeros
//   actions/ee_pose           float64 [7], fk(targets), X_BL of every group; a base gives the
//                             identity
//
// They refer to the task and the log, which live longer.
std::vector<std::shared_ptr<Sensor>> action_sensors(const Task& task, const ActionLog& log);

// Empties the rows of this world that show nothing at a terminal observation: the judgement comes
// after the sensors. `first`: no action was taken yet.
void blank_actions(SensorSuite& suite, int world, bool first);

}  // namespace mjsense
