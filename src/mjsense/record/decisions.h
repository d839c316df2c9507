// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace mjsense::record {

// Set of the attempts that were kept or discarded.
class Decisions {
 public:
  // `first`: the first attempt of the recording. `only`: its attempts, in ascending order, if they
  // are not all numbers from `first` on.
  explicit Decisions(std::int64_t first = 0, std::vector<std::int64_t> only = {})
      : only_(std::move(only)), first_(first) {}

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
  std::vector<std::int64_t> only_;
  std::int64_t first_;
  std::int64_t next_ = 0;  // position of the lowest undecided attempt
  int kept_ = 0;
};

}  // namespace mjsense::record
