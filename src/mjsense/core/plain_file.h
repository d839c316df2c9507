// SPDX-License-Identifier: Apache-2.0
#pragma once
// Files, with care. Of those whose names come from other files, only plain names inside one folder, no
// links, no pipes.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/fd.h"

namespace mjsense {

// A name that stays in its folder: not empty, at most 255 bytes, no slash, no NUL, no control
// character, not "." or "..".
[[nodiscard]] bool is_plain_name(std::string_view name);

// Opens the regular file `name` of `folder` for reading. Throws RuntimeError that says what it is
// instead: missing, a link, a pipe, no plain name, more than 1 GiB of nothing but holes.
[[nodiscard]] Fd open_plain(const std::filesystem::path& folder, std::string_view name);
[[nodiscard]] Fd open_plain(int folder, std::string_view name);  // an open one

// True for what open_plain() would open.
[[nodiscard]] bool is_plain_file(const std::filesystem::path& path);

// True for a folder that is no link.
[[nodiscard]] bool is_plain_folder(const std::filesystem::path& path);

[[nodiscard]] std::int64_t size_of(const Fd& file);

// Which file it is, and in what state: another one when it was replaced or written to.
struct FileState {
  std::uint64_t device = 0, inode = 0;
  std::int64_t bytes = -1, written_s = 0, written_ns = 0;
  bool operator==(const FileState&) const = default;
};
[[nodiscard]] FileState state_of(const Fd& file);
[[nodiscard]] FileState state_of(const std::filesystem::path& path);

// The whole of a text that somebody wrote: an experiment, a robot, a scene. Links are followed, for
// the name is the user's own. Throws ValueError when there is no such file, when it is a folder, a
// pipe or a device, when it has more than 16 MiB, and when it cannot be read.
[[nodiscard]] std::string read_text_file(const std::string& path);

// Writes all of it, in as many pieces as the system takes. False: errno says why.
[[nodiscard]] bool write_all(const Fd& file, std::span<const std::byte> bytes);

// Writes a file whole or not at all: under another name first. Throws RuntimeError that names it
// and says why the system refuses.
void write_file(const std::filesystem::path& path,
                std::initializer_list<std::span<const std::byte>> pieces);

// Text from a file as a terminal may see it: control characters, those that turn
// the direction of writing, and bytes that are no UTF-8, become '?'.
[[nodiscard]] std::string printable(std::string_view text);
// The same, but for line breaks, which stay.
[[nodiscard]] std::string printable_lines(std::string_view text);

}  // namespace mjsense
