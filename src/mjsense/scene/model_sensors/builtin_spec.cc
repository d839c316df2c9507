// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_sensors/builtin_spec.h"

#include <fmt/format.h>

#include <limits>
#include <string>

#include "mjsense/scene/model_sensors/builtin_types.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string object(const mjModel* m, int type, int id) {
  const mjtObj obj = static_cast<mjtObj>(type);
  return fmt::format("{} {}", obj_type_name(obj),
                     name_of(m, obj == mjOBJ_XBODY ? mjOBJ_BODY : obj, id));
}

std::string joint_unit(const mjModel* m, int joint) {
  return m->jnt_type[joint] == mjJNT_SLIDE ? "m" : "rad";
}

// Unit of the coordinate that "~" stands for.
std::string coordinate_unit(const mjModel* m, int sensor) {
  const int id = m->sensor_objid[sensor];
  if (m->sensor_objtype[sensor] == mjOBJ_JOINT) return joint_unit(m, id);
  if (m->sensor_objtype[sensor] == mjOBJ_ACTUATOR) {
    const int trn = m->actuator_trntype[id];
    if (trn == mjTRN_JOINT || trn == mjTRN_JOINTINPARENT)
      return joint_unit(m, m->actuator_trnid[2 * id]);
    return "m";
  }
  return "m";
}

std::string unit_of(const mjModel* m, int sensor, std::string_view unit) {
  if (unit.starts_with("~")) return coordinate_unit(m, sensor) + std::string(unit.substr(1));
  if (unit == "N or N m") return coordinate_unit(m, sensor) == "rad" ? "N m" : "N";
  return std::string(unit);
}

std::string frame_of(const mjModel* m, int sensor, const BuiltinType& type) {
  switch (type.frame) {
    case BuiltinFrame::kNone:
      return "";
    case BuiltinFrame::kPixels:
      return "pixels";
    case BuiltinFrame::kObject:
      return object(m, m->sensor_objtype[sensor], m->sensor_objid[sensor]);
    case BuiltinFrame::kWorld:
      // Acceleration sensors ignore their ref; the ref of pair sensors is the second object.
      if (type.group != BuiltinGroup::kFrame || type.type == mjSENS_FRAMELINACC ||
          type.type == mjSENS_FRAMEANGACC || m->sensor_refid[sensor] < 0) {
        return "world";
      }
      return object(m, m->sensor_reftype[sensor], m->sensor_refid[sensor]);
  }
  return "";
}

void set_bounds(const mjModel* m, int sensor, const BuiltinType& type, SensorSpec& spec) {
  const double cutoff = m->sensor_cutoff[sensor];
  const bool clamped = cutoff > 0 && type.group != BuiltinGroup::kGeomPair;
  if (clamped) spec.high = cutoff;
  switch (m->sensor_datatype[sensor]) {
    case mjDATATYPE_REAL:
      if (clamped) spec.low = -cutoff;
      break;
    case mjDATATYPE_POSITIVE:
      spec.low = 0;
      break;
    case mjDATATYPE_AXIS:
    case mjDATATYPE_QUATERNION:
      spec.low = -1;
      spec.high = 1;
      break;
    default:
      break;
  }
  if (type.type == mjSENS_INSIDESITE && m->sensor_intprm[sensor * mjNSENS] == 0) {
    spec.low = 0;
    spec.high = 1;
  }
  if (type.type == mjSENS_GEOMDIST) spec.high = cutoff;
  if (type.type == mjSENS_RANGEFINDER && m->sensor_intprm[sensor * mjNSENS] == 1 && !clamped) {
    spec.low = -1;
  }
}

std::string describe_range(const mjModel* m, int sensor, std::string_view text) {
  std::string fields;
  for (int i = 0; i < mjNRAYDATA; ++i) {
    if (m->sensor_intprm[sensor * mjNSENS] & (1 << i))
      fields += fmt::format(" {}", range_fields()[i].name);
  }
  return fields == " dist" ? std::string(text) : fmt::format("for each ray{}: {}", fields, text);
}

}  // namespace

SensorSpec describe_builtin(const mjModel* m, int id) {
  const BuiltinType& type = builtin_type(static_cast<mjtSensor>(m->sensor_type[id]));
  SensorSpec spec;
  spec.dtype = DType::kFloat32;
  spec.shape = {m->sensor_dim[id]};
  spec.unit = unit_of(m, id, type.unit);
  spec.frame = frame_of(m, id, type);
  spec.low = -kInfinity;
  spec.high = kInfinity;
  set_bounds(m, id, type, spec);
  spec.description = std::string(type.description);
  if (type.type == mjSENS_INSIDESITE && m->sensor_intprm[id * mjNSENS] != 0) {
    spec.unit = "m";
    spec.description =
        "distance by which the object protrudes from the site; <= 0: enclosed, with that clearance";
  }
  if (type.type == mjSENS_RANGEFINDER) spec.description = describe_range(m, id, type.description);
  return spec;
}

}  // namespace mjsense::scene
