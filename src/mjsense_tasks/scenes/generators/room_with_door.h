// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

// Two furnished rooms with a door between them, in the plane x = 0. It opens towards +x, so that a
// robot pushes it from one room and pulls it from the other. Names: door, door_hinge, door_handle,
// door_handle_hinge (scenes/generators/hinged_door.h), cameras view_front and view_back.
Generator room_with_door_generator();

}  // namespace mjsense::tasks::scenes
