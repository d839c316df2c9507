// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace mjsense::record {

// Set of the attempts that were kept or discarded.
class Decisions {
 public:
  // `first`: the first attempt of the recording.
  explicit Decisions(std::int64_t first = 0) : next_(first) {}

  void add(std::int64_t episode, bool kept);  // call once per episode

  bool contains(std::int64_t episode) const { return kept_by_episode_.contains(episode); }
  int kept() const { return kept_; }
  int discarded() const { return static_cast<int>(kept_by_episode_.size()) - kept_; }
  // Kept episodes, in order, that no undecided attempt can precede any more.
  const std::vector<std::int64_t>& settled() const { return settled_; }
  std::vector<std::int64_t> all_kept() const;

 private:
  std::map<std::int64_t, bool> kept_by_episode_;
  std::vector<std::int64_t> settled_;
  std::int64_t next_;  // lowest undecided episode
  int kept_ = 0;
};

}  // namespace mjsense::record
