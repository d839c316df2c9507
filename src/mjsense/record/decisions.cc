// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/decisions.h"

namespace mjsense::record {

void Decisions::add(std::int64_t episode, bool kept) {
  if (!kept_by_episode_.emplace(episode, kept).second) return;
  kept_ += kept;
  for (auto at = kept_by_episode_.find(next_); at != kept_by_episode_.end() && at->first == next_;
       ++at, ++next_) {
    if (at->second) settled_.push_back(next_);
  }
}

std::vector<std::int64_t> Decisions::all_kept() const {
  std::vector<std::int64_t> episodes;
  for (const auto& [episode, is_kept] : kept_by_episode_) {
    if (is_kept) episodes.push_back(episode);
  }
  return episodes;
}

}  // namespace mjsense::record
