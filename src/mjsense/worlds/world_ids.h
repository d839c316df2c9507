// SPDX-License-Identifier: Apache-2.0
#pragma once
// Selection of the worlds that a call applies to.

#include <concepts>
#include <span>

namespace mjsense::worlds {

struct AllWorlds {};
inline constexpr AllWorlds all_worlds;

// `all_worlds`, or a list of ids in any order; an empty list selects no world. Converts from
// anything that converts to a span of ints. The caller's list must outlive the call.
class WorldIds {
 public:
  WorldIds(AllWorlds) : all_(true) {}
  template <class List>
  requires(std::convertible_to<List&&, std::span<const int>> &&
           !std::same_as<std::remove_cvref_t<List>, WorldIds>) WorldIds(List&& ids)
      : ids_(ids) {}

  bool all() const { return all_; }
  std::span<const int> list() const { return ids_; }  // empty if all()

 private:
  std::span<const int> ids_;
  bool all_ = false;
};

}  // namespace mjsense::worlds
