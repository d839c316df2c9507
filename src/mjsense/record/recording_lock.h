// SPDX-License-Identifier: Apache-2.0
#pragma once
// Who may change the directory of a house: one process at a time, which holds {house}/.recording/lock.

#include <filesystem>

#include "mjsense/core/fd.h"
#include "mjsense/record/folder.h"

namespace mjsense {

inline constexpr const char* kLockFile = "lock";

// The lock of a house, held. An empty one where there is none and `make` is false. Throws ValueError
// when another process holds it, RuntimeError when it cannot be written.
[[nodiscard]] Fd lock_recording(const Folder& house, bool make);

// True while a process records into this house, or repairs it.
[[nodiscard]] bool is_locked(const std::filesystem::path& house);

}  // namespace mjsense
