// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/frame.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::observe {

Frame Frame::find(const mjModel* model, std::string_view context, std::string_view type,
                  std::string_view name) {
  if (type != "body" && type != "site") {
    throw ValueError(fmt::format("{}: a frame must be a body or a site, not '{}'", context, type));
  }
  const mjtObj object = type == "body" ? mjOBJ_BODY : mjOBJ_SITE;
  return {object, scene::resolve(model, object, name, context)};
}

void BodyRef::resolve(const mjModel* model, std::string_view context) {
  if (!name.empty()) id_ = scene::resolve(model, mjOBJ_BODY, name, context);
}

Pose Frame::pose(const mjData* data) const {
  if (type == mjOBJ_BODY) return body_pose(data, id);
  return site_pose(data, id);
}

}  // namespace mjsense::observe
