// SPDX-License-Identifier: Apache-2.0
#pragma once
// Separates the outcome of an episode from its details, so that summaries can count equal outcomes.

#include <string_view>

namespace mjsense::record {

// The outcome without the details of the episode, so that equal reasons are counted together: the
// planners append them in parentheses, "the policy gave up: found no plan (256 grasps: 200 out of
// reach; ...)". Other texts, such as the errors of user-defined code, are returned unchanged.
inline std::string_view outcome_without_details(std::string_view outcome) {
  // Recordings of earlier versions contain "found no way" instead.
  constexpr std::string_view kReasons[] = {"found no plan", "found no way",
                                           "a contact was too deep"};
  for (const std::string_view reason : kReasons) {
    const std::size_t begin = outcome.find(reason);
    const std::size_t end = begin + reason.size();
    if (begin != outcome.npos && outcome.substr(end).starts_with(" ("))
      return outcome.substr(0, end);
  }
  return outcome;
}

}  // namespace mjsense::record
