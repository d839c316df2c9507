// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tests whether an object is between the fingers of a gripper.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {

// True if both fingers of the gripper touch `body` or a body below it. A finger is the body of a
// pad site with the bodies below it. False for a gripper without pads and for body < 0.
bool fingers_touch(const World& world, const MoveGroup& gripper, int body);

// Sensors `<robot>_<side>_grasp_state`, one for each gripper of a robot with several: uint8 [1], 1
// if both of its fingers touch the object. The side is the part of the gripper's name before the
// first '_'. Empty for a robot with one gripper. The sensors refer to `robot`, which must outlive
// them.
std::vector<std::shared_ptr<Sensor>> finger_grasp_sensors(const Robot& robot,
                                                          const observe::BodyRef& object);

}  // namespace mjsense::tasks::robots
