#pragma once
// The five `actions/*` of an observation: what led to it. Row t belongs to the action between
// observations t-1 and t; at a terminal observation all but commanded_action are {}.

#include <memory>
#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/rollout/action_log.h"

namespace mjsense {

// Units: what each group's actuators take (MoveGroup::command_unit: rad of an arm's servos, 0 open .. 255
// closed of a gripper), m and wxyz (poses). All are JSON, their
// keys move groups. "Before" is the observation that the action answers.
//
//   actions/commanded_action  as the policy gave it, rounded to float32; {} first; keeps its value
//                             at the terminal observation. The policy's own verdict is
//                             "success":[0.0] or [1.0]
//   actions/joint_pos         the controllers' targets, without noise; first: what they hold
//   actions/joint_pos_rel     these minus qpos before; groups that have not as many targets as
//                             joints are left out; first: zeros for every group
//   actions/ee_twist          log6(inv(X_BL before) * fk(targets)) = [linear 3 (m), angular 3
//                             (rad)], in the axes of that leaf, per control step; first: zeros
//   actions/ee_pose           fk(targets), X_BL of every group; a base gives the identity
//
// They refer to the task and the log, which live longer.
std::vector<std::shared_ptr<Sensor>> action_sensors(const Task& task, const ActionLog& log);

}  // namespace mjsense
