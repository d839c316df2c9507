// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/camera_mount.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"

namespace mjsense::tasks::cameras {
namespace {

double size(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }
bool any(const std::array<double, 3>& v) {
  return std::ranges::any_of(v, [](double x) { return x != 0; });
}

}  // namespace

bool CameraMountCfg::has_noise() const {
  return fovy_noise > 0 || any(pos_noise) || any(rot_noise) || any(target_noise);
}

bool CameraMountCfg::varies() const {
  return mount == MountKind::kOrbit || (mount == MountKind::kMjcf && fovy) || has_noise() ||
         min_visible > 0;
}

void validate(const CameraMountCfg& c, std::string_view context) {
  const std::string who =
      fmt::format("{}camera '{}'", context.empty() ? "" : fmt::format("{}, ", context), c.name);
  const auto fail = [&](const std::string& what) {
    throw ValueError(fmt::format("{}: {}", who, what));
  };
  if (c.name.empty()) fail("it has no name");
  if (c.mount == MountKind::kMjcf && c.camera.empty())
    fail("mount 'mjcf' needs the name of a camera of the robot's MJCF (camera = ...)");
  if (c.mount != MountKind::kMjcf && !c.camera.empty())
    fail(fmt::format("camera = '{}' applies to mount 'mjcf' only; the mount is '{}'", c.camera,
                     c.mount.text()));
  const bool on_body = c.mount == MountKind::kBody || c.mount == MountKind::kLookAt;
  if (!on_body && !c.body.empty())
    fail(fmt::format("body = '{}' applies to mounts 'body' and 'look_at' only; the mount is '{}'",
                     c.body, c.mount.text()));
  if (c.mount == MountKind::kBody &&
      !(std::hypot(std::hypot(c.quat[0], c.quat[1]), std::hypot(c.quat[2], c.quat[3])) > 1e-6))
    fail("quat is zero");
  if (c.mount == MountKind::kLookAt || c.mount == MountKind::kFixed) {
    if (c.pos == c.target)
      fail("target is at the camera's position, so the viewing direction is undefined");
    if (!(size(c.up) > 1e-6)) fail("up is zero");
  }
  for (const auto& [name, range] :
       {std::pair{"distance_range", c.distance_range}, std::pair{"height_range", c.height_range},
        std::pair{"azimuth_range", c.azimuth_range}}) {
    if (range[0] > range[1])
      fail(fmt::format("{} is from {} to {}: the minimum must come first", name, range[0],
                       range[1]));
  }
  const double fovy = c.fovy.value_or(45);
  if (fovy - c.fovy_noise <= 0 || fovy + c.fovy_noise >= 180)
    fail(fmt::format("fovy {} +- {} degrees is not within (0, 180)", fovy, c.fovy_noise));
}

}  // namespace mjsense::tasks::cameras
