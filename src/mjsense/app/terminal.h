// SPDX-License-Identifier: Apache-2.0
#pragma once
// The width of the terminal, and text that is wrapped to it.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense::app {

// Columns of the terminal behind a file descriptor. If it is not a terminal: $COLUMNS, else 80.
std::size_t terminal_width(int fd);

// Number of characters of UTF-8 text.
std::size_t display_width(std::string_view text);

// Lines of at most `width` characters, broken at spaces. A longer word gets a line of its own.
std::vector<std::string> wrap(std::string_view text, std::size_t width);

}  // namespace mjsense::app
