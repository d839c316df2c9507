// SPDX-License-Identifier: Apache-2.0
#pragma once
// Things that several sensors of a simulation need and one of them makes: textures, tables.

#include <map>
#include <memory>
#include <string>

namespace mjsense {

class Shared {
 public:
  // What make() returned for this key, as long as anybody holds it. A key belongs to one type T.
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
