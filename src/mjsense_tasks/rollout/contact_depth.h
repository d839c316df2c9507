// SPDX-License-Identifier: Apache-2.0
#pragma once
// Finds contacts that are too deep to be real, so that an episode with one is not a success: a finger
// inside the object that it holds, an object inside a table.

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::tasks::rollout {

// Evaluation::missing of a success after such a contact.
inline constexpr std::string_view kTooDeep = "a contact was too deep";

class ContactDepth {
 public:
  // `limit`: m; 0: none.
  ContactDepth(double limit, int num_worlds) : limit_(limit), episodes_(num_worlds) {}

  bool has_limit() const { return limit_ > 0; }
  void begin(int world) { episodes_[world] = {}; }
  // Reads the contacts of an observation, whose data is fresh. Pairs of geoms that are deeper than
  // the limit in the first one of an episode are part of its start, such as feet in soft ground.
  // They are skipped in the later ones. Worlds may be read in parallel.
  void observe(const World& world);
  bool is_exceeded(int world) const { return episodes_[world].deepest.has_value(); }
  // "5.4 mm in step 37: 'robot_0/gripper/left_pad' and 'can'; max_penetration is 3 mm"; "" if the
  // limit is not exceeded.
  std::string description(int world, const mjModel* model) const;

 private:
  struct Deepest {
    double depth;  // m
    int step;
    std::pair<int, int> geoms;
  };
  struct Episode {
    int step = 0;  // of the next observation
    std::set<std::pair<int, int>> start;
    std::optional<Deepest> deepest;
  };

  double limit_;
  std::vector<Episode> episodes_;  // [B]
};

}  // namespace mjsense::tasks::rollout
