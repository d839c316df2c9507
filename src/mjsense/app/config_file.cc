#include <fmt/format.h>
#include <toml++/toml.h>

#include <filesystem>
#include <functional>
#include <map>

#include "mjsense/app/record_command.h"
#include "mjsense/core/error.h"

namespace mjsense {
namespace {

// What a key of the file sets. A setter returns false if the value is of another type.
using Setter = std::function<bool(const toml::node&)>;

template <class T>
Setter into(T& target) {
  return [&target](const toml::node& node) {
    const auto value = node.value_exact<T>();
    if (value) target = *value;
    return value.has_value();
  };
}

template <class T>
Setter whole_number(T& target) {
  return [&target](const toml::node& node) {
    const auto value = node.value_exact<std::int64_t>();
    if (value) target = static_cast<T>(*value);
    return value.has_value();
  };
}

Setter text(std::function<void(const std::string&)> parse) {
  return [parse = std::move(parse)](const toml::node& node) {
    const auto value = node.value_exact<std::string>();
    if (value) parse(*value);
    return value.has_value();
  };
}

Setter unless(bool& target) {
  return [&target](const toml::node& node) {
    const auto value = node.value_exact<bool>();
    if (value) target = !*value;
    return value.has_value();
  };
}

// A list of names, or the text of the command line.
Setter cameras(RolloutCfg& rollout) {
  return [&rollout](const toml::node& node) {
    if (const auto value = node.value_exact<std::string>()) {
      parse_cameras(*value, rollout);
      return true;
    }
    const toml::array* list = node.as_array();
    if (!list) return false;
    std::vector<std::string> names;
    for (const toml::node& item : *list) {
      const auto name = item.value_exact<std::string>();
      if (!name) return false;
      names.push_back(*name);
    }
    rollout.cameras = std::move(names);
    return true;
  };
}

std::map<std::string, Setter> setters(RecordOptions& options) {
  RecordJobCfg& job = options.job;
  RolloutCfg& rollout = job.rollout;
  return {
      {"task", into(rollout.task)},
      {"robot", into(rollout.robot)},
      {"policy", into(rollout.policy)},
      {"episodes", whole_number(job.episodes)},
      {"max_attempts", whole_number(job.max_attempts)},
      {"worlds", whole_number(rollout.num_worlds)},
      {"threads", whole_number(rollout.threads)},
      {"seed", whole_number(rollout.seed)},
      {"out", text([&job](const std::string& path) { job.out = path; })},
      {"cameras", cameras(rollout)},
      {"size", text([&rollout](const std::string& size) { parse_size(size, rollout); })},
      {"depth", into(rollout.depth)},
      {"samples", whole_number(rollout.samples)},
      {"no_shadows", unless(rollout.shadows)},
      {"horizon", whole_number(rollout.horizon)},
      {"no_noise", unless(rollout.action_noise)},
      {"keep_failures", into(job.keep_failures)},
      {"house", whole_number(job.house)},
      {"batches", whole_number(job.batches)},
      {"gzip", whole_number(job.gzip)},
      {"crf", whole_number(job.video.crf)},
      {"preset", into(job.video.preset)},
      {"ffmpeg", into(job.video.ffmpeg)},
      {"molmospaces_depth", into(job.video.molmospaces_depth)},
  };
}

}  // namespace

void read_config(const std::string& path, RecordOptions& options) {
  if (!std::filesystem::is_regular_file(path)) {
    throw ValueError(fmt::format("{}: no such file", path));
  }
  toml::table table;
  try {
    table = toml::parse_file(path);
  } catch (const toml::parse_error& e) {
    throw ValueError(
        fmt::format("{}:{}: {}", path, e.source().begin.line, std::string(e.description())));
  }
  const std::map<std::string, Setter> known = setters(options);
  std::vector<std::string> names;
  for (const auto& [name, setter] : known) names.push_back(name);
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    const auto place = fmt::format("{}:{}", path, node.source().begin.line);
    const auto setter = known.find(name);
    if (setter == known.end()) throw_unknown(place, "key", name, names);
    if (!setter->second(node)) {
      throw ValueError(fmt::format("{}: the value of '{}' is of a wrong type", place, name));
    }
  }
}

}  // namespace mjsense
