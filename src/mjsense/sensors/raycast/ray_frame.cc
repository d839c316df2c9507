// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/ray_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::sensors {

void validate_frame(const scene::ObjRef& ref, std::string_view context) {
  if (ref.name.empty()) throw ValueError(fmt::format("{}: a frame has no name", context));
  const std::array<std::string_view, 5> types = {"body", "xbody", "site", "geom", "camera"};
  if (std::find(types.begin(), types.end(), ref.type) == types.end())
    throw ValueError(
        fmt::format("{}: frame '{}' is a '{}': must be 'body', 'site', or 'geom' ('xbody' and "
                    "'camera' are accepted too)",
                    context, ref.full_name(), ref.type));
}

RayFrame::RayFrame(const mjModel* m, const scene::Scene* scene, const scene::ObjRef& ref,
                   std::string_view context) {
  validate_frame(ref, context);
  const scene::ResolvedObj obj = scene::resolve(m, scene, ref, context);
  type_ = obj.type;
  id_ = obj.id;
  switch (type_) {
    case mjOBJ_BODY:
    case mjOBJ_XBODY:
      body_ = id_;
      break;
    case mjOBJ_SITE:
      body_ = m->site_bodyid[id_];
      break;
    case mjOBJ_GEOM:
      body_ = m->geom_bodyid[id_];
      break;
    default:
      body_ = m->cam_bodyid[id_];
  }
}

FramePose RayFrame::pose(const mjData* d, RayAlignment alignment) const {
  const mjtNum* pos = d->xpos;
  const mjtNum* mat = d->xmat;
  if (type_ == mjOBJ_SITE) {
    pos = d->site_xpos;
    mat = d->site_xmat;
  } else if (type_ == mjOBJ_GEOM) {
    pos = d->geom_xpos;
    mat = d->geom_xmat;
  } else if (type_ == mjOBJ_CAMERA) {
    pos = d->cam_xpos;
    mat = d->cam_xmat;
  }
  FramePose pose;
  std::copy_n(pos + 3 * id_, 3, pose.pos);
  std::copy_n(mat + 9 * id_, 9, pose.mat);
  align_rays(alignment, pose.mat, pose.align);
  return pose;
}

void align_rays(RayAlignment alignment, const double mat[9], float out[9]) {
  if (alignment == RayAlignment::kBase) {
    std::copy_n(mat, 9, out);
    return;
  }
  double x = 1, y = 0;
  if (alignment == RayAlignment::kYaw) {
    x = mat[0];
    y = mat[3];
    if (std::hypot(x, y) < 0.1) {
      const double length = std::max(std::hypot(mat[1], mat[4]), 1e-6);
      x = mat[4] / length;
      y = -mat[1] / length;
    }
    const double length = std::max(std::hypot(x, y), 1e-6);
    x /= length;
    y /= length;
  }
  const double a[9] = {x, -y, 0, y, x, 0, 0, 0, 1};
  std::copy_n(a, 9, out);
}

}  // namespace mjsense::sensors
