// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/description_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <nlohmann/json.hpp>
#include <string_view>

#include "mjsense/core/files/regular_file.h"
#include "mjsense/record/molmospaces.h"

namespace mjsense::replay {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kRateDigits = 12;
constexpr double kMinRate = 1e-5, kMaxRate = 1e6;  // observations per second
constexpr std::size_t kShown = 60;

bool is_number(std::string_view text) {
  return !text.empty() && text.size() <= kRateDigits &&
         std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

// "15" or "500/33"
bool is_rate(const Json& value) {
  if (!value.is_string()) return false;
  const auto& text = value.get_ref<const std::string&>();
  const std::size_t slash = std::min(text.find('/'), text.size());
  const std::string above = text.substr(0, slash);
  const std::string below = slash == text.size() ? "1" : text.substr(slash + 1);
  if (!is_number(above) || !is_number(below)) return false;
  const double rate = std::atof(above.c_str()) / std::atof(below.c_str());
  return rate >= kMinRate && rate <= kMaxRate;
}

bool is_whole(const Json& value, std::int64_t low, std::int64_t high) {
  return value.is_number_integer() && value.get<double>() >= static_cast<double>(low) &&
         value.get<double>() <= static_cast<double>(high);
}

bool is_word(const Json& value) {
  return value.is_string() && std::ranges::all_of(value.get_ref<const std::string&>(),
                                                  [](char c) { return c >= 'a' && c <= 'z'; });
}

struct Rule {
  std::string_view key;
  std::function<bool(const Json&)> holds;
  std::string_view expected;
};

const std::array<Rule, 7>& video_rules() {
  static const std::array<Rule, 7> rules = {
      {{"crf", [](const Json& v) { return is_whole(v, 0, 51); }, "0 to 51"},
       {"preset", is_word, "a word"},
       {"tune", is_word, "a word"},
       {"keyint", [](const Json& v) { return is_whole(v, 1, 100'000); }, "1 to 100000"},
       {"threads", [](const Json& v) { return is_whole(v, 1, 64); }, "1 to 64"},
       {"depth_unit",
        [](const Json& v) {
          return v.is_number() && v.get<double>() > 0 && v.get<double>() <= 1000;
        },
        "metres above 0, and at most 1000"},
       {"molmospaces_depth", [](const Json& v) { return v.is_boolean(); }, "true or false"}}};
  return rules;
}

std::string shown(const Json& value) {
  return printable(value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, kShown));
}

}  // namespace

std::vector<ListedStream> listed_places(const Json& description) {
  std::vector<ListedStream> found;
  for (const char* list : {"/streams", "/settings/render/carried"}) {
    const Json::json_pointer place(list);
    if (!description.contains(place) || !description.at(place).is_array()) continue;
    for (const Json& entry : description.at(place)) {  // "wrist_camera uint8(12, 16, 3)"
      if (!entry.is_string()) continue;
      const auto& text = entry.get_ref<const std::string&>();
      const std::string name = text.substr(0, text.rfind(' ', text.rfind('(')));
      std::string video = name;
      std::ranges::replace(video, '/', '_');
      found.push_back({name, {record::path_of(name), "obs/sensor_data/" + video}});
    }
  }
  return found;
}

std::vector<std::string> description_faults(const Json& description) {
  std::vector<std::string> faults;
  const auto require = [&](const Json& table, std::string_view key, const auto& holds,
                           std::string_view expected, std::string_view shown_key) {
    const auto value = table.find(key);
    if (value != table.end() && !holds(*value))
      faults.push_back(
          fmt::format("whose {} is {}, expected {}", shown_key, shown(*value), expected));
  };
  require(description, "fps", is_rate, "a rate such as \"500/33\"", "fps");
  require(
      description, "gzip", [](const Json& v) { return is_whole(v, 0, 9); }, "0 to 9", "gzip");
  require(
      description, "model_archive",
      [](const Json& v) { return v.is_string() && is_plain_name(v.get_ref<const std::string&>()); },
      "a plain file name", "model_archive");
  require(
      description, "settings", [](const Json& v) { return v.is_object(); }, "an object",
      "settings");
  const auto video = description.find("video");
  if (video == description.end()) return faults;
  if (!video->is_object()) {
    faults.emplace_back("whose video is not an object");
    return faults;
  }
  for (const Rule& rule : video_rules())
    require(*video, rule.key, rule.holds, rule.expected, fmt::format("video.{}", rule.key));
  for (const auto& [key, value] : video->items()) {
    const std::string& name = key;  // lambdas of C++20 in clang 14 cannot name a structured binding
    if (std::ranges::none_of(video_rules(), [&name](const Rule& rule) { return rule.key == name; }))
      faults.push_back(
          fmt::format("with video.{}, which is never recorded", printable(key.substr(0, kShown))));
  }
  return faults;
}

}  // namespace mjsense::replay
