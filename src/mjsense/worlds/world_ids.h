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
  // A WorldIds does not convert to a span, so this constructor does not replace the copy constructor.
  template <class List>
  // NOLINTNEXTLINE(bugprone-forwarding-reference-overload)
  requires std::convertible_to<List&&, std::span<const int>> WorldIds(List&& ids) : ids_(ids) {}

  bool all() const { return all_; }
  std::span<const int> list() const { return ids_; }  // empty if all()

 private:
  std::span<const int> ids_;
  bool all_ = false;
};

}  // namespace mjsense::worlds
