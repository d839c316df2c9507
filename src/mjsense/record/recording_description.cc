// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_description.h"

#include <nlohmann/json.hpp>

namespace mjsense::record {

nlohmann::json parse_description(const std::string& text) {
  using Json = nlohmann::json;
  constexpr std::size_t kMaxBytes = std::size_t{1} << 22;
  constexpr int kMaxDepth = 64;
  const Json none(Json::value_t::discarded);
  if (text.size() > kMaxBytes) return none;
  bool deep = false;
  Json json = Json::parse(
      text,
      [&](int depth, Json::parse_event_t, Json&) {
        deep |= depth > kMaxDepth;
        return !deep;
      },
      false);
  return deep ? none : json;
}

}  // namespace mjsense::record
