// SPDX-License-Identifier: Apache-2.0
#pragma once
// A sentence of documentation in a declaration of fields (core/fields/fields.h).

#include <cstddef>

namespace mjsense {

// A sentence of documentation, checked at compile time.
class Sentence {
 public:
  // NOLINT: implicit conversion from a literal is intended
  consteval Sentence(const char* text) : text_(text) {
    const std::size_t length = __builtin_strlen(text);
    if (length < 2 || text[length - 1] != '.') throw "needs a sentence that ends with a full stop";
  }
  constexpr const char* text() const { return text_; }

 private:
  const char* text_;
};

}  // namespace mjsense
