// SPDX-License-Identifier: Apache-2.0
#pragma once
// Changes of files that are there after kill -9 and a power failure, or not at all. Each throws
// RuntimeError "cannot write '...': No space left on device".

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "mjsense/core/fd.h"

namespace mjsense {

[[noreturn]] void throw_file(const char* deed, const std::filesystem::path& path, int error);

void sync_file(const std::filesystem::path& path);  // or folder
void rename_file(const std::filesystem::path& from, const std::filesystem::path& to);
void write_whole(const std::filesystem::path& path, std::string_view text);

// A new file with the bytes and the rights of `from`.
void copy_file(const Fd& from, const std::filesystem::path& to);

// Takes the disk space of a file before it is written: on a full disk that is a plain error, while
// the HDF5 library may crash where it cannot write in the middle of a copy.
void reserve_space(const std::filesystem::path& path, std::int64_t bytes);

}  // namespace mjsense
