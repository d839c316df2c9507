// SPDX-License-Identifier: Apache-2.0
#pragma once
// The table of MuJoCo's sensor types: what each takes, measures, and in which unit and frame.

#include <mujoco/mujoco.h>

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

// What the sensor is attached to, and what its `ref` may be.
enum class BuiltinGroup {
  kSite,         // obj: site
  kRangefinder,  // obj: site or camera
  kJoint,        // obj: joint
  kTendon,       // obj: tendon
  kActuator,     // obj: actuator
  kFrame,        // obj: body xbody geom site camera; ref: the same, optional
  kSubtree,      // obj: body
  kWorld,        // no obj
  kProjection,   // obj: site, ref: camera
  kInside,       // obj: body xbody geom site camera, ref: site
  kGeomPair,     // obj and ref: geom or body
  kTactile,      // obj: mesh of taxels, ref: geom in whose frame it stands
  kPlugin,       // obj and ref: anything, optional
  kUser,         // obj: anything, optional
  kContact,      // only found in XML
};

enum class BuiltinFrame {
  kNone,    // a scalar, a quaternion's own meaning, a time
  kObject,  // axes of the object
  kWorld,   // global axes; with a ref, the ref's
  kPixels,
};

struct BuiltinType {
  std::string_view name;  // as in MJCF
  mjtSensor type;
  BuiltinGroup group;
  BuiltinFrame frame;
  std::string_view unit;  // "~" and "~/s": rad or m, after the joint
  std::string_view description;
};

std::span<const BuiltinType> builtin_types();

// Throws ValueError with the nearest names.
const BuiltinType& builtin_type(std::string_view name, std::string_view place);
const BuiltinType& builtin_type(mjtSensor type);

// Types of objects that this group takes as obj and as ref; empty: none.
std::vector<std::string> allowed_objects(BuiltinGroup group);
std::vector<std::string> allowed_refs(BuiltinGroup group);

// Names of a rangefinder's data fields in MuJoCo's order, and their sizes.
struct RangeField {
  std::string_view name;
  int size;
};
std::span<const RangeField> range_fields();

}  // namespace mjsense
