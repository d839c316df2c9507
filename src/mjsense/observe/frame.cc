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
  return {object, object_id(model, object, context, name)};
}

void BodyRef::resolve(const mjModel* model, std::string_view context) {
  if (!name.empty()) id_ = object_id(model, mjOBJ_BODY, context, name);
}

Pose Frame::pose(const mjData* data) const {
  if (type == mjOBJ_BODY) return body_pose(data, id);
  return site_pose(data, id);
}

std::vector<std::string> object_names(const mjModel* model, mjtObj type) {
  return scene::model_names(model, type);
}

int object_id(const mjModel* model, mjtObj type, std::string_view context, std::string_view name) {
  return scene::resolve(model, type, name, context);
}

}  // namespace mjsense::observe
