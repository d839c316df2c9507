// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/frame.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"

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

namespace {
struct Kind {
  int count;
  const char* name;
};

Kind kind_of(const mjModel* model, mjtObj type) {
  switch (type) {
    case mjOBJ_BODY:
      return {static_cast<int>(model->nbody), "body"};
    case mjOBJ_SITE:
      return {static_cast<int>(model->nsite), "site"};
    case mjOBJ_GEOM:
      return {static_cast<int>(model->ngeom), "geom"};
    case mjOBJ_CAMERA:
      return {static_cast<int>(model->ncam), "camera"};
    case mjOBJ_JOINT:
      return {static_cast<int>(model->njnt), "joint"};
    case mjOBJ_ACTUATOR:
      return {static_cast<int>(model->nu), "actuator"};
    default:
      throw ValueError(fmt::format("names of MuJoCo objects of type {} are not supported",
                                   static_cast<int>(type)));
  }
}
}  // namespace

std::vector<std::string> object_names(const mjModel* model, mjtObj type) {
  std::vector<std::string> names(kind_of(model, type).count);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const char* name = mj_id2name(model, type, static_cast<int>(i));
    if (name) names[i] = name;
  }
  return names;
}

int object_id(const mjModel* model, mjtObj type, std::string_view context, std::string_view name) {
  const int id = mj_name2id(model, type, std::string(name).c_str());
  if (id < 0) throw_unknown(context, kind_of(model, type).name, name, object_names(model, type));
  return id;
}

}  // namespace mjsense::observe
