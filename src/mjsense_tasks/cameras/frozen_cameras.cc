// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/frozen_cameras.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"

namespace mjsense::tasks::cameras {
namespace {

using Json = nlohmann::ordered_json;

template <std::size_t N>
std::array<double, N> numbers(const Json& camera, const char* key, const std::string& who) {
  const auto found = camera.find(key);
  const bool right = found != camera.end() && found->is_array() && found->size() == N &&
                     std::ranges::all_of(*found, [](const Json& x) { return x.is_number(); });
  if (!right) throw ValueError(fmt::format("{}: '{}' must be {} numbers", who, key, N));
  return found->get<std::array<double, N>>();
}

CameraMountCfg read_camera(const std::string& name, const Json& camera, std::string_view prefix,
                           const std::string& who) {
  if (!camera.is_object()) throw ValueError(who + ": must be an object");
  CameraMountCfg out;
  out.name = name;
  out.pos = numbers<3>(camera, "pos", who);
  const auto fovy = camera.find("fovy");
  if (fovy == camera.end() || !fovy->is_number())
    throw ValueError(who + ": 'fovy' must be a number");
  out.fovy = fovy->get<double>();
  out.depth = camera.contains("depth") && camera["depth"] == true;
  if (!camera.contains("body")) {
    out.mount = MountKind::kFixed;
    const auto forward = numbers<3>(camera, "forward", who);
    for (int i = 0; i < 3; ++i) out.target[i] = out.pos[i] + forward[i];
    out.up = numbers<3>(camera, "up", who);
    return out;
  }
  out.mount = MountKind::kBody;
  out.quat = numbers<4>(camera, "quat", who);
  const std::string body = camera["body"].is_string() ? camera["body"].get<std::string>() : "";
  if (!body.starts_with(prefix))
    throw ValueError(fmt::format("{}: body '{}' does not belong to a robot", who, body));
  out.body = body.substr(prefix.size());
  return out;
}

}  // namespace

CameraSystemCfg read_frozen(std::string_view json, std::string_view prefix,
                            std::string_view context) {
  const Json all = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!all.is_object() || all.empty())
    throw ValueError(fmt::format(
        "{}: must be a JSON object of cameras by name, like 'cameras' in obs_scene", context));
  CameraSystemCfg system;
  for (const auto& [name, camera] : all.items())
    system.cameras.push_back(
        read_camera(name, camera, prefix, fmt::format("{}, camera '{}'", context, name)));
  return system;
}

}  // namespace mjsense::tasks::cameras
