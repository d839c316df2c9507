// SPDX-License-Identifier: Apache-2.0
#pragma once
// Safe file access. Files whose names come from other files must be regular files directly in one
// folder: no links, no pipes.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/files/file_descriptor.h"

namespace mjsense {

// True for a name that cannot leave its folder: not empty, at most 255 bytes, no slash, no NUL, no
// control character, not "." or "..".
[[nodiscard]] bool is_plain_name(std::string_view name);

// Opens the regular file `name` in `folder` for reading. Throws RuntimeError that says why it
// cannot: missing, a link, a pipe, not a plain name, or a sparse file with more than 1 GiB of
// holes.
[[nodiscard]] Fd open_plain(const std::filesystem::path& folder, std::string_view name);
[[nodiscard]] Fd open_plain(int folder, std::string_view name);  // an open one

// True if open_plain() would open it.
[[nodiscard]] bool is_plain_file(const std::filesystem::path& path);

// True for a folder that is not a link.
[[nodiscard]] bool is_plain_folder(const std::filesystem::path& path);

[[nodiscard]] std::int64_t size_of(const Fd& file);

// Identity and state of a file. It changes if the file is replaced or written to.
struct FileState {
  std::uint64_t device = 0, inode = 0;
  std::int64_t bytes = -1, written_s = 0, written_ns = 0;
  bool operator==(const FileState&) const = default;
};
[[nodiscard]] FileState state_of(const Fd& file);
[[nodiscard]] FileState state_of(const std::filesystem::path& path);

// Reads a whole user-written text file: an experiment, a robot, a scene. Links are followed,
// because the user chose the name. Throws ValueError if the file does not exist, is a folder, a
// pipe or a device, has more than 16 MiB, or cannot be read.
[[nodiscard]] std::string read_text_file(const std::string& path);

// Writes all bytes, in as many calls as needed. Returns false on failure, with the reason in errno.
[[nodiscard]] bool write_all(const Fd& file, std::span<const std::byte> bytes);

// Writes a file atomically: to a temporary name, then renamed. Throws RuntimeError with the path
// and the system's reason.
void write_file(const std::filesystem::path& path,
                std::initializer_list<std::span<const std::byte>> pieces);

// Makes text from a file safe for a terminal: control characters, characters that change the
// direction of writing, and bytes that are not UTF-8 become '?'.
[[nodiscard]] std::string printable(std::string_view text);
// The same, but for line breaks, which stay.
[[nodiscard]] std::string printable_lines(std::string_view text);

}  // namespace mjsense
