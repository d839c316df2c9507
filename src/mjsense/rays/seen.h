// SPDX-License-Identifier: Apache-2.0
#pragma once
// What was last seen of an array of MuJoCo's, so that what stays the same costs a comparison of
// bytes.

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <vector>

namespace mjsense {

template <typename T>
class Seen {
 public:
  explicit Seen(std::size_t size) : last_(size) {}

  // Are these `count` values from `first` on other than when they were last seen (at first: zeros)?
  // They are now.
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

}  // namespace mjsense
