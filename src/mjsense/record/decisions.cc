// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/decisions.h"

#include <iterator>

namespace mjsense::record {

void Decisions::add(std::int64_t episode, bool kept) {
  if (!kept_by_episode_.emplace(episode, kept).second) return;
  kept_ += kept;
  for (;; ++next_) {
    if (!only_.empty() && next_ >= std::ssize(only_)) return;
    const auto at = kept_by_episode_.find(only_.empty() ? first_ + next_ : only_[next_]);
    if (at == kept_by_episode_.end()) return;
    if (at->second) settled_.push_back(at->first);
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
