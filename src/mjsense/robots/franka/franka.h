#pragma once
// Franka Research 3 with a Robotiq-like gripper on a pedestal: the station of the DROID data set.

#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

RobotCfg franka_cfg();

}  // namespace mjsense
