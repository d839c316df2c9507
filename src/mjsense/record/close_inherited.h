// SPDX-License-Identifier: Apache-2.0
#pragma once
// A child process inherits no file but its three streams, whatever a library opened without
// O_CLOEXEC.

#include <spawn.h>

namespace mjsense {

// Adds the closing of every file from 3 on to what the child does before it begins.
void close_inherited(posix_spawn_file_actions_t* actions);

}  // namespace mjsense
