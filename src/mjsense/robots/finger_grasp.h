// SPDX-License-Identifier: Apache-2.0
#pragma once
// Whether the fingers of a gripper have something between them.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"
#include "mjsense/robots/robot.h"

namespace mjsense {

// Both fingers of a gripper - the bodies of its pad sites and what hangs on them - touch the body or
// what hangs on it. False for a gripper without pads and for body < 0.
bool fingers_touch(const World& world, const MoveGroup& gripper, int body);

// `<robot>_<side>_grasp_state` of each gripper of a robot with several: uint8 [1], 1 where its
// fingers have the object between them. The side is what the gripper's name begins with. Empty for
// a robot with one gripper. They refer to the robot, which lives longer.
std::vector<std::shared_ptr<Sensor>> finger_grasp_sensors(const Robot& robot,
                                                          const BodyRef& object);

}  // namespace mjsense
