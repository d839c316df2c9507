// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/recording_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/json.h"
#include "mjsense/record/checksum.h"
#include "mjsense/render/light/environment_image.h"
#include "mjsense_tasks/scenes/load_scene.h"

namespace mjsense::tasks::rollout {
namespace {

using Json = nlohmann::json;
using Kind = FieldType::Kind;

Json json_of(const FieldDecl& field, const void* object) {
  std::vector<std::uint8_t> text(256);
  for (;;) {
    JsonWriter writer(text);
    write_json(writer, field, object);
    if (writer.fits())
      return Json::parse(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(writer.size()));
    text.resize(writer.size());
  }
}

// Adds a value of any declared type to the checksum, recursively.
void add_value(record::Checksum& sum, const FieldType& type, const void* value) {
  // const_cast: the functions of a type are shared between reading and writing.
  void* v = const_cast<void*>(value);
  const auto add_text = [&](std::string_view text) {
    const std::size_t size = text.size();  // separates "ab", "c" from "a", "bc"
    sum.add(&size, sizeof size);
    sum.add(text.data(), size);
  };
  const auto add_fields = [&](const StructDecl& decl, const void* object) {
    add_text(decl.name);
    for (const FieldDecl& field : decl.fields) {
      if (!field.type) continue;
      add_text(field.name);
      add_value(sum, *field.type, static_cast<const char*>(object) + field.offset);
    }
  };
  switch (type.kind) {
    case Kind::kBool:
    case Kind::kInt:
    case Kind::kUnsigned:
    case Kind::kEnum: {
      const std::int64_t x =
          type.kind == Kind::kBool ? *static_cast<const bool*>(value) : get_integer(type, value);
      return sum.add(&x, sizeof x);
    }
    case Kind::kNumber: {
      const double x = get_number(type, value);
      return sum.add(&x, sizeof x);
    }
    case Kind::kText:
      return add_text(*static_cast<const std::string*>(value));
    case Kind::kPath:
      return add_text(static_cast<const std::filesystem::path*>(value)->string());
    case Kind::kArray:
    case Kind::kList:
    case Kind::kOptional:
    case Kind::kMap: {
      const std::size_t count = type.count(v);
      sum.add(&count, sizeof count);
      for (std::size_t i = 0; i < count; ++i) {
        if (type.kind == Kind::kMap) add_text(*type.key_at(v, i));
        add_value(sum, type.element(), type.at(v, i));
      }
      return;
    }
    case Kind::kObject:
      return add_fields(type.object(), value);
    case Kind::kChoice: {
      const int which = type.which(value);
      sum.add(&which, sizeof which);
      if (which >= 0) add_fields(*type.alternatives()[which], type.get(v));
      return;
    }
  }
}

// Checksum of each field of a struct that was read from a file.
template <Described T>
Json checksums_of(const T& object) {
  Json sums = Json::object();
  for (const FieldDecl& field : struct_of<T>().fields) {
    if (!field.type || std::string_view(field.name) == "description") continue;
    record::Checksum sum;
    add_value(sum, *field.type, reinterpret_cast<const char*>(&object) + field.offset);
    sums[field.name] = sum.text();
  }
  return sums;
}

Json cameras_of(const Rollout& rollout) {
  Json cameras = Json::array();
  for (const RecordedCamera& camera : rollout.cameras()) {
    Json entry{{"camera", camera.mjcf_camera},
               {"depth", camera.depth},
               {"height", camera.height},
               {"name", camera.name},
               {"width", camera.width}};
    if (camera.segmentation) entry["segmentation"] = true;
    cameras.push_back(std::move(entry));
  }
  return cameras;
}

void require_code(const RecordJobCfg& job) {
  const RolloutCfg& cfg = job.rollout;
  const auto require = [&](bool is_own, std::string_view part) {
    const auto has = [&](const auto& entry) { return entry.first.starts_with(part); };
    if ((job.resume || job.append) && is_own && std::ranges::none_of(cfg.code, has))
      throw ValueError(
          fmt::format("cannot continue: the {} is made by the calling program and RolloutCfg::code "
                      "does not describe it, so it cannot be compared with that of the recording",
                      part));
  };
  require(bool{cfg.make_task}, "task");
  require(bool{cfg.make_policy}, "policy");
  require(bool{cfg.more_sensors}, "sensor");
}

}  // namespace

std::string recording_settings(const RecordJobCfg& job, Rollout& rollout) {
  require_code(job);
  const RolloutCfg& cfg = job.rollout;
  const episode::TaskCfg& task = rollout.task().cfg();
  Json settings{{"cameras", cameras_of(rollout)},
                {"horizon", task.horizon},
                {"max_penetration", *rollout.cfg().max_penetration},
                {"meshes", task.robot.edit_spec ? "real" : "shapes"},
                {"policy_dt_ms", task.policy_dt_ms}};
  for (const FieldDecl& field : struct_of<RecordJobCfg>().fields) {
    if (!field.fingerprint) continue;
    if (!field.is_resolved) {
      settings[field.fingerprint] = json_of(field, &job);
    } else if (!settings.contains(field.fingerprint)) {
      throw std::logic_error(
          fmt::format("field '{}' has the fingerprint key '{}', which is not among the settings",
                      field.name, field.fingerprint));
    }
  }
  if (!cfg.robot.empty()) settings["robot_file"] = checksums_of(task.robot);
  if (cfg.make_scene || !cfg.scene.empty())
    settings["scene_file"] = checksums_of(scenes::task_scene(task, ""));
  const auto add_file = [&](const char* key, const std::string& path) {
    const std::string text = read_text_file(path);
    record::Checksum sum;
    sum.add(text.data(), text.size());
    settings[key] = sum.text();
  };
  if (cfg.camera_system.ends_with(".toml") || cfg.camera_system.ends_with(".json"))
    add_file("camera_file", cfg.camera_system);
  if (!cfg.backdrop.empty()) add_file("backdrop_file", cfg.backdrop);
  if (cfg.shading != sensors::Shading::kClassic && render::is_environment_file(cfg.environment)) {
    const std::string bytes = render::read_environment_file(cfg.environment);
    record::Checksum sum;
    sum.add(bytes.data(), bytes.size());
    settings["environment_file"] = sum.text();
  }
  if (!cfg.starts.empty()) {
    record::Checksum sum;
    sum.add(cfg.starts.data(), cfg.starts.size());
    settings["starts"] = sum.text();
  }
  if (!cfg.code.empty()) settings["code"] = cfg.code;
  return settings.dump();
}

}  // namespace mjsense::tasks::rollout
