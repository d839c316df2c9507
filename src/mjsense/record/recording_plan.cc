// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/record/model_checksums.h"
#include "mjsense/record/molmospaces.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/record/yuv.h"

namespace mjsense::record {
namespace {

// About 128 KiB: large enough for gzip and the file system to be efficient, small enough for the
// buffers of many worlds to fit in the cache.
constexpr std::size_t kChunkBytes = 1 << 17;
constexpr std::int64_t kMaxChunkRows = 512;

// Datasets that the recorder itself writes into every episode.
constexpr const char* kOwnPaths[] = {"rewards",    "success",   "fail",
                                     "terminated", "truncated", "obs_scene"};

void check_path(const std::string& sensor, const std::string& stream) {
  std::size_t start = 0;
  while (true) {
    const std::size_t end = std::min(stream.find('/', start), stream.size());
    const std::string part = stream.substr(start, end - start);
    if (part.empty() || part == "." || part == ".." || part.find('\0') != std::string::npos) {
      throw ValueError(fmt::format(
          "sensor '{}': its stream '{}' cannot be stored: a name between slashes is empty or a dot",
          sensor, stream));
    }
    if (end == stream.size()) return;
    start = end + 1;
  }
}

std::string flat(std::string name) {
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

void add_videos(const RecordingCfg& cfg, const Sensor& sensor, const Field& field,
                std::vector<VideoStream>& videos) {
  const SensorSpec& spec = field.spec;
  const bool rgb = spec.storage == Storage::kRgbVideo;
  const bool right =
      rgb ? spec.dtype == DType::kUint8 && spec.shape.rank() == 3 && spec.shape[2] == 3
          : spec.dtype == DType::kFloat32 && spec.shape.rank() == 2;
  if (!right || spec.shape.size() == 0) {
    throw ValueError(fmt::format("sensor '{}': stream '{}' is {}{}, but {} is {}", sensor.name(),
                                 spec.name, dtype_name(spec.dtype), spec.shape.str(),
                                 rgb ? "an RGB video" : "a depth video",
                                 rgb ? "uint8 (height, width, 3)" : "float32 (height, width)"));
  }
  VideoStream video{&sensor,
                    &field,
                    rgb ? VideoKind::kRgb : VideoKind::kDepth16,
                    flat(spec.name),
                    flat(spec.name),
                    rgb ? ".mp4" : ".mkv",
                    static_cast<int>(spec.shape[1]),
                    static_cast<int>(spec.shape[0])};
  if (!rgb && cfg.video.molmospaces_depth) {
    // MolmoSpaces' loaders expect their encoding under the camera's depth name; mjsense's lossless
    // video is stored in addition to it.
    VideoStream lossy = video;
    lossy.kind = VideoKind::kDepthRedGreen;
    lossy.extension = ".mp4";
    videos.push_back(lossy);
    video.key += "_16bit";
  }
  videos.push_back(video);
}

// False for the field of a move group without joints, and for the flag of such a group.
bool has_numbers(const Sensor& sensor, const Field& field) {
  constexpr std::string_view kGiven = "given/";
  if (!field.name.starts_with(kGiven)) return field.spec.shape.size() > 0;
  const auto group =
      std::ranges::find(sensor.fields(), field.name.substr(kGiven.size()), &Field::name);
  return group == sensor.fields().end() || group->spec.shape.size() > 0;
}

// "mug" for the float fields "actors/mug" and "articulations/mug", which are the state of a thing of
// the scene; "" for other fields.
std::string thing_of(const Field& field) {
  const bool number = field.spec.dtype == DType::kFloat32 || field.spec.dtype == DType::kFloat64;
  for (const std::string_view group : {"actors/", "articulations/"}) {
    if (number && field.name.starts_with(group)) return field.name.substr(group.size());
  }
  return "";
}

// The field "present/mug" that belongs to the field "actors/mug" of the same sensor, or null.
const Field* presence_of(const Sensor& sensor, const Field& field) {
  const std::string thing = thing_of(field);
  if (thing.empty()) return nullptr;
  const auto found = std::ranges::find(sensor.fields(), "present/" + thing, &Field::name);
  return found != sensor.fields().end() && found->spec.dtype == DType::kBool ? &*found : nullptr;
}

// Flag of a thing that is present in every episode. Observations do not have it.
SensorSpec always_present(const Sensor& sensor, const std::string& thing) {
  SensorSpec spec;
  spec.name = fmt::format("{}/present/{}", sensor.name(), thing);
  spec.dtype = DType::kBool;
  spec.shape = {};
  spec.description = "Whether the body takes part in the episode.";
  return spec;
}

// Two datasets cannot have the same path, and a dataset cannot be a group.
void check_paths(const std::map<std::string, std::string>& owners) {
  for (const auto& [path, owner] : owners) {
    for (std::size_t slash = path.find('/'); slash != std::string::npos;
         slash = path.find('/', slash + 1)) {
      if (const auto above = owners.find(path.substr(0, slash)); above != owners.end()) {
        throw ValueError(fmt::format("{} is stored as '{}', inside '{}' of {}; rename one of them",
                                     owner, path, above->first, above->second));
      }
    }
  }
}

std::string fingerprint(const RecordingCfg& cfg, const RecordingPlan& plan,
                        const nlohmann::json& streams) {
  nlohmann::json settings;
  try {
    settings = nlohmann::json::parse(cfg.settings);
  } catch (const nlohmann::json::exception&) {
    throw ValueError(fmt::format("recording: settings is not JSON text: {:.80}", cfg.settings));
  }
  nlohmann::json j{{"format", 1},
                   {"house", cfg.house},
                   {"episodes", cfg.episodes},
                   {"batches", batches_of(cfg.episodes, cfg.batches).count},
                   {"fps", cfg.fps.str()},
                   {"gzip", cfg.gzip},
                   {"streams", streams},
                   {"settings", settings},
                   {"versions", {{"mjsense", MJSENSE_VERSION}, {"mujoco", mj_versionString()}}}};
  if (!cfg.archive_name.empty()) j["model_archive"] = cfg.archive_name;
  if (cfg.first_attempt > 0) j["first_attempt"] = cfg.first_attempt;
  if (cfg.num_attempts > 0) j["num_attempts"] = cfg.num_attempts;
  if (!cfg.attempts.empty()) j["attempts"] = cfg.attempts;
  if (cfg.first_batch > 0) j["first_batch"] = cfg.first_batch;
  if (cfg.model) j["model"] = model_checksums(*cfg.model);
  if (!plan.videos.empty()) {
    const VideoCfg& v = cfg.video;
    j["video"] = {{"crf", v.crf},
                  {"preset", v.preset},
                  {"tune", v.tune},
                  {"keyint", v.keyint},
                  {"threads", v.threads},
                  {"depth_unit", v.depth_unit},
                  {"molmospaces_depth", v.molmospaces_depth}};
  }
  return j.dump();
}

// Assigns paths to the streams of sensors, one after the other.
class PlanBuilder {
 public:
  explicit PlanBuilder(const RecordingCfg& cfg) : cfg_(cfg) {}

  RecordingPlan build() {
    for (const char* own : kOwnPaths) claim(own, "the recorder");
    for (const char* group : standard_groups()) claim(group, "the layout");
    for (const Sensor* sensor : cfg_.sensors) add(sensor);
    for (const char* group : standard_groups()) owners_.erase(group);
    check_paths(owners_);
    plan_.fingerprint = fingerprint(cfg_, plan_, streams_);
    return std::move(plan_);
  }

 private:
  void add(const Sensor* sensor) {
    if (sensor == nullptr) throw ValueError("recording: a sensor of the suite is null");
    check_fields(*sensor);
    if (const auto text = text_of(*sensor)) {
      add_text(*sensor, *text);
      return;
    }
    for (const Field& field : sensor->fields()) add_field(*sensor, field);
    if (sensor->name() == "env_states") add_presence(*sensor);
  }

  void check_fields(const Sensor& sensor) const {
    if (sensor.fields().empty()) {
      throw ValueError(
          fmt::format("sensor '{}' has no fields: initialize it before recording", sensor.name()));
    }
    for (const Field& field : sensor.fields()) {
      if (field.data.shape().rank() == 0 || field.data.shape()[0] < cfg_.num_worlds) {
        throw ValueError(fmt::format("sensor '{}': stream '{}' has shape {}, expected rows of {}",
                                     sensor.name(), field.spec.name, field.data.shape().str(),
                                     counted(cfg_.num_worlds, "world")));
      }
    }
  }

  // One dataset with the text of all fields, and a dataset for each field of numbers.
  void add_text(const Sensor& sensor, const SensorSpec& text) {
    add_to_fingerprint(sensor, text);
    add_array(sensor, {.spec = text, .text = std::make_shared<JsonRows>(sensor, text.str_max_len)});
    for (const Field& field : sensor.fields()) {
      if (!has_numbers(sensor, field)) continue;
      ArrayStream numbers{.spec = field.spec, .field = &field};
      numbers.path = numbers_path(path_of(sensor.name()), field.name);
      add_array(sensor, std::move(numbers));
    }
  }

  void add_field(const Sensor& sensor, const Field& field) {
    const bool array = field.spec.storage == Storage::kArray;
    if (!cfg_.videos && !array) return;
    add_to_fingerprint(sensor, field.spec);
    if (array) {
      add_array(sensor,
                {.spec = field.spec, .field = &field, .present = presence_of(sensor, field)});
      return;
    }
    const std::size_t first = plan_.videos.size();
    add_videos(cfg_, sensor, field, plan_.videos);
    for (std::size_t i = first; i < plan_.videos.size(); ++i)
      claim("obs/sensor_data/" + plan_.videos[i].key, owner_of(sensor));
  }

  // The flags of things without a flag of their own, which are present in every episode.
  void add_presence(const Sensor& env_states) {
    for (const Field& field : env_states.fields()) {
      const std::string thing = thing_of(field);
      if (!thing.empty() && !owners_.contains(path_of("env_states/present/" + thing)))
        add_array(env_states, {.spec = always_present(env_states, thing)});
    }
  }

  void add_array(const Sensor& sensor, ArrayStream stream) {
    stream.sensor = &sensor;
    if (stream.path.empty()) stream.path = path_of(stream.spec.name);
    stream.chunk_rows = chunk_rows(stream.row_bytes());
    claim(stream.path, owner_of(sensor));
    plan_.arrays.push_back(std::move(stream));
  }

  void add_to_fingerprint(const Sensor& sensor, const SensorSpec& spec) {
    check_path(sensor.name(), spec.name);
    streams_.push_back(fmt::format("{} {}{}", spec.name, dtype_name(spec.dtype), spec.shape.str()));
  }

  void claim(const std::string& path, const std::string& owner) {
    const auto [at, fresh] = owners_.emplace(path, owner);
    if (!fresh)
      throw ValueError(fmt::format("{} and {} would both be stored as '{}'; rename one of them",
                                   at->second, owner, path));
  }

  static std::string owner_of(const Sensor& sensor) {
    return fmt::format("sensor '{}'", sensor.name());
  }

  const RecordingCfg& cfg_;
  RecordingPlan plan_;
  nlohmann::json streams_ = nlohmann::json::array();  // in the order of the suite
  std::map<std::string, std::string> owners_;         // by path: "sensor 'x'"
};

}  // namespace

Fps Fps::from_period_ms(std::int64_t policy_dt_ms) {
  if (policy_dt_ms <= 0)
    throw ValueError(fmt::format("policy_dt_ms is {}, expected a positive number", policy_dt_ms));
  const std::int64_t common = std::gcd<std::int64_t>(1000, policy_dt_ms);
  return {1000 / common, policy_dt_ms / common};
}

std::string Fps::str() const {
  return den == 1 ? fmt::format("{}", num) : fmt::format("{}/{}", num, den);
}

std::size_t VideoStream::frame_bytes() const {
  if (kind == VideoKind::kRgb) return yuv420_bytes(width, height);
  return static_cast<std::size_t>(width) * height * (kind == VideoKind::kDepth16 ? 2 : 3);
}

std::int64_t chunk_rows(std::size_t row_bytes) {
  return std::clamp<std::int64_t>(
      static_cast<std::int64_t>(kChunkBytes / std::max<std::size_t>(1, row_bytes)), 1,
      kMaxChunkRows);
}

std::string_view ArrayStream::kind() const { return text ? "json" : sensor->kind(); }

std::size_t ArrayStream::row_bytes() const { return spec.shape.size() * dtype_size(spec.dtype); }

std::size_t ArrayStream::kept_bytes() const { return text ? text->row_bytes() : row_bytes(); }

RecordingPlan plan_recording(const RecordingCfg& cfg) { return PlanBuilder(cfg).build(); }

Batches batches_of(int episodes, int batches) {
  if (episodes <= 0)
    throw ValueError(fmt::format("recording: episodes is {}, expected at least 1", episodes));
  if (batches < 0 || batches > episodes) {
    throw ValueError(fmt::format(
        "recording: {} batches for {} episodes, expected 1 to {} (0: about 4 episodes each)",
        batches, episodes, episodes));
  }
  if (batches == 0)
    batches = std::max(
        // Like Python's round(): half to even.
        1, static_cast<int>(std::nearbyint(episodes / 4.0)));
  return {episodes, batches};
}

std::int64_t Batches::first(int batch) const {
  return std::int64_t{batch} * (episodes / count) + std::min(batch, episodes % count);
}

std::string batch_file(int batch, int batches) {
  return fmt::format("trajectories_batch_{}_of_{}.h5", batch + 1, batches);
}

std::string video_file(std::int64_t episode, std::string_view name) {
  return fmt::format("episode_{:08d}_{}", episode, name);
}

std::string spec_json(std::string_view sensor, std::string_view kind, const SensorSpec& spec) {
  constexpr const char* kStorage[] = {"array", "rgb_video", "depth_video"};
  nlohmann::json j{
      {"name", spec.name},
      {"sensor", sensor},
      {"kind", kind},
      {"dtype", dtype_name(spec.dtype)},
      {"shape", std::vector<std::int64_t>(spec.shape.dims().begin(), spec.shape.dims().end())},
      {"is_dict", spec.is_dict},
      {"storage", kStorage[static_cast<int>(spec.storage)]}};
  if (std::isfinite(spec.low)) j["low"] = spec.low;
  if (std::isfinite(spec.high)) j["high"] = spec.high;
  if (spec.is_dict) j["str_max_len"] = spec.str_max_len;
  return j.dump();
}

std::string fingerprint_difference(const std::string& was, const std::string& now) {
  if (was == now) return "";
  const nlohmann::json a = parse_description(was), b = parse_description(now);
  if (!a.is_object() || !b.is_object()) return "its description cannot be read";
  const nlohmann::json difference = nlohmann::json::diff(a, b);
  if (difference.empty()) return "";
  // A changed setting may also have changed the model, the streams and the number of batches, so it
  // is reported first.
  constexpr std::string_view kConsequences[] = {"/batches", "/model", "/streams"};
  const auto is_consequence = [&](const nlohmann::json& change) {
    const auto& path = change["path"].get_ref<const std::string&>();
    return std::ranges::any_of(kConsequences, [&](auto start) { return path.starts_with(start); });
  };
  const auto named = std::ranges::find_if_not(difference, is_consequence);
  const nlohmann::json::json_pointer at(
      (named == difference.end() ? difference.front() : *named)["path"].get<std::string>());
  const auto text = [&](const nlohmann::json& j) {
    return j.contains(at) ? j[at].dump() : std::string("absent");
  };
  return fmt::format("'{}' was {:.100} and is now {:.100}", at.to_string().substr(1), text(a),
                     text(b));
}

}  // namespace mjsense::record
