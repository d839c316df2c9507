// SPDX-License-Identifier: Apache-2.0
#pragma once
// Cache of objects that several sensors of a simulation share, such as textures and tables.

#include <map>
#include <memory>
#include <string>

namespace mjsense {

class SharedCache {
 public:
  // The object for this key: the existing one while anyone holds it, otherwise the result of
  // make(). A key always belongs to one type T.
  template <class T, class Make>
  std::shared_ptr<const T> get(const std::string& key, Make&& make) {
    std::weak_ptr<const void>& kept = kept_[key];
    if (auto found = std::static_pointer_cast<const T>(kept.lock())) return found;
    std::shared_ptr<const T> made = make();
    kept = made;
    return made;
  }

 private:
  std::map<std::string, std::weak_ptr<const void>> kept_;
};

}  // namespace mjsense
