// SPDX-License-Identifier: Apache-2.0
#pragma once
// The action of a policy: commands for one control step of one world. Plain memory, no allocation.

#include <array>
#include <optional>
#include <span>
#include <string>

#include "mjsense/core/error.h"

namespace mjsense::tasks::robots {

// Values of one move group: joint positions (qpos; a free joint has 7), or a command.
struct GroupValues {
  static constexpr int kMaxSize = 32;
  std::array<double, kMaxSize> values{};
  int size = 0;
  bool given = false;  // false: no command for this group, its controller holds

  std::span<const double> view() const { return {values.data(), static_cast<std::size_t>(size)}; }
  // Throws ValueError for more than kMaxSize values.
  void set(std::span<const double> xs) {
    if (xs.size() > kMaxSize) {
      throw ValueError("a move group takes at most " + std::to_string(kMaxSize) + " values, not " +
                       std::to_string(xs.size()));
    }
    size = static_cast<int>(xs.size());
    for (int i = 0; i < size; ++i) values[i] = xs[i];
    given = true;
  }
};

// The values of every move group, in the robot's order.
struct RobotValues {
  static constexpr int kMaxGroups = 16;
  std::array<GroupValues, kMaxGroups> groups{};
  GroupValues& operator[](int g) { return groups[g]; }
  const GroupValues& operator[](int g) const { return groups[g]; }
};

struct Action {
  // in the format of each group's controller; an uncontrolled base has size 0
  RobotValues commands;
  bool done = false;            // the policy has finished: the episode ends after this step
  std::optional<bool> success;  // the policy's own verdict; {done, success: false} means it gave up
};

}  // namespace mjsense::tasks::robots
