// SPDX-License-Identifier: Apache-2.0
#pragma once
// Phases of the planners that grasp objects; the numbers are part of the recording format.

#include "mjsense_tasks/episode/policy.h"

namespace mjsense::tasks::policies {

enum ManipulationPhase {
  kUnknownPhase = 0,
  kOpenGripper = 1,
  kPregrasp = 2,
  kGrasp = 3,
  kCloseGripper = 4,
  kLift = 5,
  kPreplace = 6,
  kPlace = 7,
  kRetreat = 8,
  kGoHome = 9
};
inline constexpr episode::Phase kManipulationPhases[] = {{"unknown", kUnknownPhase},
                                                         {"gripper-open", kOpenGripper},
                                                         {"pregrasp", kPregrasp},
                                                         {"grasp", kGrasp},
                                                         {"gripper-close", kCloseGripper},
                                                         {"lift", kLift},
                                                         {"preplace", kPreplace},
                                                         {"place", kPlace},
                                                         {"retreat", kRetreat},
                                                         {"go_home", kGoHome}};

}  // namespace mjsense::tasks::policies
