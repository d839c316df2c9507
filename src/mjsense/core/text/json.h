// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writer for the JSON text of dict sensors, byte for byte equal to Python's json.dumps(x,
// sort_keys=True, separators=(",", ":")): floats in their shortest round-trip form, NaN and
// Infinity as Python writes them, ASCII only. Writes directly into a fixed-size row and allocates
// nothing.

#include <cstdint>
#include <span>
#include <string_view>

namespace mjsense {

class JsonWriter {
 public:
  // Writes into `row`; finish() fills the unused bytes with 0.
  explicit JsonWriter(std::span<std::uint8_t> row) : row_(row) {}

  // Writes NaN and infinities as null from here on, so that the text is standard JSON.
  JsonWriter& finite_only() {
    finite_only_ = true;
    return *this;
  }

  // Members of an object must be written in sorted order of their keys; otherwise std::logic_error
  // is thrown.
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

  // Number of bytes of the whole text, even if it does not fit.
  std::size_t size() const { return size_; }
  [[nodiscard]] bool fits() const { return size_ <= row_.size(); }

  // Pads with 0 and returns fits(). The caller must report a text that does not fit; it must not be
  // truncated silently.
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

// Python's repr(float): the shortest text that parses to x ("1.0", "1e-05", "-0.0", "NaN",
// "Infinity"). Writes at most 32 bytes and returns their number.
int format_python_float(double x, char* out);

}  // namespace mjsense
