// SPDX-License-Identifier: Apache-2.0
#pragma once
// The grippers of a robot and the sensors of their tools.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {

std::vector<const MoveGroup*> grippers_of(const Robot& robot);
// The part of a gripper's name before the first '_': "left" of "left_gripper".
std::string side_of(const MoveGroup& gripper);
// Pose of the point between the finger tips in the robot's base frame.
std::shared_ptr<Sensor> tool_pose_sensor(const mjModel* model, const Robot& robot,
                                         const MoveGroup& gripper, std::string name);

}  // namespace mjsense::tasks::robots
