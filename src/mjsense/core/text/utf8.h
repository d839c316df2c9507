// SPDX-License-Identifier: Apache-2.0
#pragma once
// Validation of UTF-8 (RFC 3629).

#include <cstddef>
#include <string_view>

namespace mjsense {

// Number of bytes of the first character of `text`, which must not be empty; 0 if it is not valid
// UTF-8. Overlong forms, surrogates and code points beyond U+10FFFF are invalid.
constexpr std::size_t utf8_size(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t size = first >= 0xF0 && first < 0xF5   ? 4
                           : first >= 0xE0 && first < 0xF0 ? 3
                           : first >= 0xC2 && first < 0xE0 ? 2
                                                           : 0;
  if (size == 0 || size > text.size()) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  if ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) >= 0xA0)) return 0;
  if ((first == 0xF0 && byte(1) < 0x90) || (first == 0xF4 && byte(1) >= 0x90)) return 0;
  return size;
}

}  // namespace mjsense
