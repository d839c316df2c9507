// SPDX-License-Identifier: Apache-2.0
#pragma once
// The outcome of an episode, as recordings store it and summaries count it.

#include <string_view>

namespace mjsense {

// The outcome without the details of the episode, so that equal reasons are counted together: the
// planners append them in parentheses, "the policy gave up: found no plan (256 grasps: 200 out of
// reach; ...)". Other texts, such as the errors of user-defined code, are returned unchanged.
inline std::string_view outcome_without_details(std::string_view outcome) {
  constexpr std::string_view kReason = "found no plan";
  const std::size_t begin = outcome.find(kReason);
  const std::size_t end = begin + kReason.size();
  return begin != outcome.npos && outcome.substr(end).starts_with(" (") ? outcome.substr(0, end)
                                                                        : outcome;
}

}  // namespace mjsense
