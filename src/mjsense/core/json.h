// SPDX-License-Identifier: Apache-2.0
#pragma once
// JSON text of dict sensors, byte for byte what Python's
// json.dumps(x, sort_keys=True, separators=(",", ":")) gives (spec: floats as their shortest round
// trip, NaN and Infinity as Python writes them, ASCII only), written straight into a fixed row.
// Nothing allocates.

#include <cstdint>
#include <span>
#include <string_view>

namespace mjsense {

class JsonWriter {
 public:
  // Writes into `row`; what is not used is filled with 0 by finish().
  explicit JsonWriter(std::span<std::uint8_t> row) : row_(row) {}

  // From here on NaN and infinities are written as null, so that the text is JSON by the standard.
  JsonWriter& finite_only() {
    finite_only_ = true;
    return *this;
  }

  // Members of an object must be written in sorted order of their keys; a key that is not raises
  // std::logic_error.
  JsonWriter& begin_object();
  JsonWriter& end_object();
  JsonWriter& begin_array();
  JsonWriter& end_array();
  JsonWriter& key(std::string_view name);

  JsonWriter& value(double x);
  JsonWriter& value(std::int64_t x);
  JsonWriter& value(std::uint64_t x);
  JsonWriter& value(int x) { return value(static_cast<std::int64_t>(x)); }
  JsonWriter& value(bool x);
  JsonWriter& value(std::string_view text);
  JsonWriter& value(const char* text) { return value(std::string_view(text)); }

  // A list of numbers.
  JsonWriter& values(std::span<const double> xs);

  // Bytes that the whole text needs, also when it did not fit.
  std::size_t size() const { return size_; }
  [[nodiscard]] bool fits() const { return size_ <= row_.size(); }

  // Pads with 0. Returns fits(): a text that does not fit is the caller's error to report, never
  // cut silently.
  [[nodiscard]] bool finish();

 private:
  void put(char c);
  void put(std::string_view text);
  void string(std::string_view text);
  JsonWriter& integer(auto x);
  void separate();

  std::span<std::uint8_t> row_;
  std::size_t size_ = 0;
  bool comma_ = false;
  bool finite_only_ = false;
  static constexpr int kMaxDepth = 16;
  static constexpr int kMaxKey = 64;
  int depth_ = 0;
  struct Level {
    char last[kMaxKey];
    int length = -1;
  } levels_[kMaxDepth];
};

// Python's repr(float): the shortest text that reads back as x ("1.0", "1e-05", "-0.0", "NaN",
// "Infinity"). Writes at most 32 bytes; returns their number.
int format_python_float(double x, char* out);

}  // namespace mjsense
