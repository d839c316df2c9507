// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_sensors/builtin_draw.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/scene/model_sensors/builtin_types.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

struct FrameRows {
  const mjtNum *pos, *mat;  // null if objects of this type have no frame
};

FrameRows frame_rows(const mjData* d, mjtObj type) {
  switch (type) {
    case mjOBJ_BODY:
      return {d->xipos, d->ximat};
    case mjOBJ_XBODY:
      return {d->xpos, d->xmat};
    case mjOBJ_GEOM:
      return {d->geom_xpos, d->geom_xmat};
    case mjOBJ_SITE:
      return {d->site_xpos, d->site_xmat};
    case mjOBJ_CAMERA:
      return {d->cam_xpos, d->cam_xmat};
    default:
      return {};
  }
}

}  // namespace

void draw_sensor_frame(const World& world, int id, const std::string& name, DebugShapes& shapes) {
  const mjModel* m = world.model;
  const auto type = static_cast<mjtObj>(m->sensor_objtype[id]);
  const FrameRows rows = frame_rows(world.data, type);
  if (!rows.pos) {
    const std::string object = type == mjOBJ_UNKNOWN ? "nothing" : "a " + obj_type_name(type);
    throw ValueError(fmt::format(
        "sensor '{}': nothing to draw: this {} sensor is attached to {}, which has no frame", name,
        builtin_type(static_cast<mjtSensor>(m->sensor_type[id])).name, object));
  }
  const int object = m->sensor_objid[id];
  shapes.add_frame(vec3(rows.pos + 3 * object), rows.mat + 9 * object, 5.0 * shapes.meansize(),
                   0.2 * shapes.meansize(), name);
}

}  // namespace mjsense::scene
