// SPDX-License-Identifier: Apache-2.0
#pragma once
// Table of MuJoCo's sensor types: the elements they refer to, what they measure, unit and frame.

#include <mujoco/mujoco.h>

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense::scene {

// Kinds of elements that the sensor is attached to (obj) and that `ref` may name.
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
  kTactile,      // obj: mesh of taxels, ref: geom that defines its frame
  kPlugin,       // obj and ref: anything, optional
  kUser,         // obj: anything, optional
  kContact,      // can only be defined in XML
};

enum class BuiltinFrame {
  kNone,    // a scalar, a quaternion, or a time
  kObject,  // axes of the object
  kWorld,   // world axes; axes of `ref` if there is one
  kPixels,
};

struct BuiltinType {
  std::string_view name;  // as in MJCF
  mjtSensor type;
  BuiltinGroup group;
  BuiltinFrame frame;
  std::string_view unit;  // "~" and "~/s" stand for rad or m, depending on the joint
  std::string_view description;
};

std::span<const BuiltinType> builtin_types();

// Throws ValueError with the nearest names.
const BuiltinType& builtin_type(std::string_view name, std::string_view context);
const BuiltinType& builtin_type(mjtSensor type);

// Object types that this group accepts as obj and as ref; empty: none.
std::vector<std::string> allowed_objects(BuiltinGroup group);
std::vector<std::string> allowed_refs(BuiltinGroup group);

// Names and sizes of a rangefinder's data fields, in MuJoCo's order.
struct RangeField {
  std::string_view name;
  int size;
};
std::span<const RangeField> range_fields();

}  // namespace mjsense::scene
