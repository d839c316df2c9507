// SPDX-License-Identifier: Apache-2.0
#pragma once
// Lock of a house's directory. Only the process that holds {house}/.recording/lock may change it.

#include <filesystem>

#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/record/folder.h"

namespace mjsense::record {

inline constexpr const char* kLockFile = "lock";

// Acquires the lock of a house. The result is empty if there is no lock file and `make` is false.
// Throws ValueError if another process holds the lock, RuntimeError if it cannot be written.
[[nodiscard]] Fd lock_recording(const Folder& house, bool make);

// True while a process records into this house or repairs it.
[[nodiscard]] bool is_locked(const std::filesystem::path& house);

}  // namespace mjsense::record
