// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/description.h"

#include <nlohmann/json.hpp>

namespace mjsense {

nlohmann::json parse_description(const std::string& text) {
  using Json = nlohmann::json;
  constexpr std::size_t kMostBytes = std::size_t{1} << 22;
  constexpr int kMostDepth = 64;
  const Json none(Json::value_t::discarded);
  if (text.size() > kMostBytes) return none;
  bool deep = false;
  Json json = Json::parse(
      text,
      [&](int depth, Json::parse_event_t, Json&) {
        deep |= depth > kMostDepth;
        return !deep;
      },
      false);
  return deep ? none : json;
}

}  // namespace mjsense
