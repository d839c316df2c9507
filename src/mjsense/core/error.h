// SPDX-License-Identifier: Apache-2.0
#pragma once
// Errors whose messages name the place, the value, the expectation and the nearest valid names.

#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

// Exception type in Python: ValueError, KeyError, RuntimeError.
enum class ErrorKind { kValue, kKey, kRuntime };

class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

// An invalid argument or configuration.
struct ValueError : Error {
  explicit ValueError(const std::string& message) : Error(ErrorKind::kValue, message) {}
};

// An unknown name.
struct KeyError : Error {
  explicit KeyError(const std::string& message) : Error(ErrorKind::kKey, message) {}
};

// A failure outside the library's control: a file, a program, the physics.
struct RuntimeError : Error {
  explicit RuntimeError(const std::string& message) : Error(ErrorKind::kRuntime, message) {}
};

// Returns up to `maximum` candidates nearest to `name` by edit distance, nearest first. Candidates
// that differ too much are left out.
[[nodiscard]] std::vector<std::string> nearest_names(std::string_view name,
                                                     std::span<const std::string> candidates,
                                                     std::size_t maximum = 3);

// "; did you mean 'a' or 'b'?" or, if no candidate is near, "; available: a, b, c" (the first 12).
// "" if there are no candidates.
[[nodiscard]] std::string suggest(std::string_view name, std::span<const std::string> candidates);

// Throws KeyError "sensor 'feet': no geom named 'FR_fot'; did you mean 'FR_foot'?"
[[noreturn]] void throw_unknown(std::string_view context, std::string_view kind,
                                std::string_view name, std::span<const std::string> candidates);

}  // namespace mjsense
