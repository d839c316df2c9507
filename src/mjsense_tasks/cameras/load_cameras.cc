// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/load_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_fields.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense_tasks/cameras/frozen_cameras.h"

namespace mjsense::tasks::cameras {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEmbedded = "embedded:", kTail = ".toml", kFrozen = ".json";

bool is_file(std::string_view name) { return name.ends_with(kTail) || name.ends_with(kFrozen); }

// Returns "embedded:robots/franka/cameras/", or a folder on disk.
std::string folder_of(std::string_view robot_file) {
  return resolve_relative(robot_file, "cameras/");
}

DataFolder embedded(const std::string& folder) {
  return {"camera system", std::string_view(folder).substr(kEmbedded.size()), kTail};
}

}  // namespace

std::vector<std::string> camera_system_names(std::string_view robot_file) {
  const std::string folder = folder_of(robot_file);
  if (folder.starts_with(kEmbedded)) return embedded(folder).names();
  std::vector<std::string> names;
  if (!fs::is_directory(folder)) return names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == kTail) names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}

CameraSystemCfg load_camera_system(std::string_view name, std::string_view robot_file,
                                   std::string_view prefix) {
  // A camera system of another robot: "franka/droid".
  if (const auto slash = name.find('/'); slash != name.npos && !is_file(name)) {
    const std::string other =
        fmt::format("{}robots/{}/robot.toml", kEmbedded, name.substr(0, slash));
    return load_camera_system(name.substr(slash + 1), other, prefix);
  }
  if (name.ends_with(kFrozen)) {
    CameraSystemCfg cfg = read_frozen(read_text_file(std::string(name)), prefix, name);
    cfg.name = fs::path(name).stem().string();
    check_fields(cfg, fmt::format("camera system '{}'", cfg.name));
    return cfg;
  }
  const std::string folder = folder_of(robot_file);
  const std::vector<std::string> names = camera_system_names(robot_file);
  DataFile file;
  if (name.ends_with(kTail)) {
    file = DataFolder{"camera system", "", kTail}.find(name);
  } else if (folder.starts_with(kEmbedded)) {
    file = embedded(folder).find(name);
  } else if (std::ranges::find(names, name) != names.end()) {
    file = DataFolder{"camera system", "", kTail}.find(fmt::format("{}{}{}", folder, name, kTail));
  } else {
    throw_unknown(fmt::format("{}", folder), "camera system", name, names);
  }
  CameraSystemCfg cfg;
  cfg.name = fs::path(file.path).stem().string();
  read_toml_fields(file.text, file.path, cfg);
  check_fields(cfg, fmt::format("camera system '{}'", cfg.name));
  return cfg;
}

}  // namespace mjsense::tasks::cameras
