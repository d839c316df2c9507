// SPDX-License-Identifier: Apache-2.0
#pragma once
// Detects changes in MuJoCo's arrays by comparing bytes with a copy, so that unchanged values cost
// only the comparison.

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <vector>

namespace mjsense::rays {

template <typename T>
class ChangeDetector {
 public:
  explicit ChangeDetector(std::size_t size) : last_(size) {}

  // Returns whether the `count` values from `first` on differ from the copy (initially zeros), and
  // updates the copy.
  bool changed(const T* values, std::size_t first, std::size_t count) {
    if (count == 0 || std::memcmp(&last_[first], values + first, count * sizeof(T)) == 0)
      return false;
    std::copy_n(values + first, count, &last_[first]);
    return true;
  }
  bool changed(const T* values) { return changed(values, 0, last_.size()); }

 private:
  std::vector<T> last_;
};

}  // namespace mjsense::rays
