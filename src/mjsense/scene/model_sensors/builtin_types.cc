// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_sensors/builtin_types.h"

#include <array>

#include "mjsense/core/error.h"

namespace mjsense::scene {
namespace {

using G = BuiltinGroup;
using F = BuiltinFrame;

constexpr BuiltinType kTypes[] = {
    {"touch", mjSENS_TOUCH, G::kSite, F::kNone, "N",
     "sum of the normal forces of contacts of the site's body inside the site's volume, >= 0"},
    {"accelerometer", mjSENS_ACCELEROMETER, G::kSite, F::kObject, "m/s^2",
     "proper acceleration R^T (a - g): +g up at rest, 0 in free fall"},
    {"velocimeter", mjSENS_VELOCIMETER, G::kSite, F::kObject, "m/s",
     "linear velocity of the site's origin, in its axes"},
    {"gyro", mjSENS_GYRO, G::kSite, F::kObject, "rad/s", "angular velocity, in the site's axes"},
    {"force", mjSENS_FORCE, G::kSite, F::kObject, "N",
     "force that the parent applies to the site's body: +mg up under a supported load"},
    {"torque", mjSENS_TORQUE, G::kSite, F::kObject, "N m",
     "torque about the site that the parent applies to the site's body"},
    {"magnetometer", mjSENS_MAGNETOMETER, G::kSite, F::kObject, "",
     "the scene's option `magnetic`, in the site's axes"},
    {"rangefinder", mjSENS_RANGEFINDER, G::kRangefinder, F::kNone, "m",
     "distance along a site's +Z, or along a camera's pixel rays, to the nearest visible geom; -1 "
     "where there is none"},
    {"camprojection", mjSENS_CAMPROJECTION, G::kProjection, F::kPixels, "px",
     "pixel (x to the right, y down from the top left corner) of the site, not clipped; points "
     "behind the camera too"},
    {"jointpos", mjSENS_JOINTPOS, G::kJoint, F::kNone, "~", "position of a hinge or slide"},
    {"jointvel", mjSENS_JOINTVEL, G::kJoint, F::kNone, "~/s", "velocity of a hinge or slide"},
    {"tendonpos", mjSENS_TENDONPOS, G::kTendon, F::kNone, "m", "length of the tendon"},
    {"tendonvel", mjSENS_TENDONVEL, G::kTendon, F::kNone, "m/s", "rate of the tendon's length"},
    {"actuatorpos", mjSENS_ACTUATORPOS, G::kActuator, F::kNone, "~",
     "length of the transmission, gear included"},
    {"actuatorvel", mjSENS_ACTUATORVEL, G::kActuator, F::kNone, "~/s",
     "velocity of the transmission, gear included"},
    {"actuatorfrc", mjSENS_ACTUATORFRC, G::kActuator, F::kNone, "N or N m",
     "scalar force of the actuator, before the gear"},
    {"jointactuatorfrc", mjSENS_JOINTACTFRC, G::kJoint, F::kNone, "N or N m",
     "force of all actuators at the joint, with gravity compensation if that is routed there"},
    {"tendonactuatorfrc", mjSENS_TENDONACTFRC, G::kTendon, F::kNone, "N",
     "sum of the forces of the actuators on the tendon"},
    {"ballquat", mjSENS_BALLQUAT, G::kJoint, F::kNone, "",
     "orientation of a ball joint, unit quaternion w, x, y, z"},
    {"ballangvel", mjSENS_BALLANGVEL, G::kJoint, F::kNone, "rad/s",
     "angular velocity of a ball joint, in the axes of its body"},
    {"jointlimitpos", mjSENS_JOINTLIMITPOS, G::kJoint, F::kNone, "~",
     "distance to the nearer limit less the margin, negative when violated; 0 while inactive"},
    {"jointlimitvel", mjSENS_JOINTLIMITVEL, G::kJoint, F::kNone, "~/s",
     "rate of the distance to the active limit, negative when approaching; 0 while inactive"},
    {"jointlimitfrc", mjSENS_JOINTLIMITFRC, G::kJoint, F::kNone, "N or N m",
     "force of the active limit, >= 0"},
    {"tendonlimitpos", mjSENS_TENDONLIMITPOS, G::kTendon, F::kNone, "m",
     "distance to the nearer limit less the margin, negative when violated; 0 while inactive"},
    {"tendonlimitvel", mjSENS_TENDONLIMITVEL, G::kTendon, F::kNone, "m/s",
     "rate of the distance to the active limit, negative when approaching; 0 while inactive"},
    {"tendonlimitfrc", mjSENS_TENDONLIMITFRC, G::kTendon, F::kNone, "N",
     "force of the active limit, >= 0"},
    {"framepos", mjSENS_FRAMEPOS, G::kFrame, F::kWorld, "m",
     "position of the object's frame; with a ref R_r^T (p - p_r)"},
    {"framequat", mjSENS_FRAMEQUAT, G::kFrame, F::kWorld, "",
     "orientation of the object's frame, unit quaternion w, x, y, z; with a ref q_r^-1 q"},
    {"framexaxis", mjSENS_FRAMEXAXIS, G::kFrame, F::kWorld, "",
     "x axis of the object's frame, unit vector"},
    {"frameyaxis", mjSENS_FRAMEYAXIS, G::kFrame, F::kWorld, "",
     "y axis of the object's frame, unit vector"},
    {"framezaxis", mjSENS_FRAMEZAXIS, G::kFrame, F::kWorld, "",
     "z axis of the object's frame, unit vector"},
    {"framelinvel", mjSENS_FRAMELINVEL, G::kFrame, F::kWorld, "m/s",
     "velocity of the frame's origin; with a ref R_r^T (v - v_r - w_r x (p - p_r))"},
    {"frameangvel", mjSENS_FRAMEANGVEL, G::kFrame, F::kWorld, "rad/s",
     "angular velocity of the frame; with a ref R_r^T (w - w_r)"},
    {"framelinacc", mjSENS_FRAMELINACC, G::kFrame, F::kWorld, "m/s^2",
     "proper acceleration a - g of the frame's origin, global axes; a ref is ignored"},
    {"frameangacc", mjSENS_FRAMEANGACC, G::kFrame, F::kWorld, "rad/s^2",
     "angular acceleration, global axes; a ref is ignored"},
    {"subtreecom", mjSENS_SUBTREECOM, G::kSubtree, F::kWorld, "m",
     "centre of mass of the body's subtree"},
    {"subtreelinvel", mjSENS_SUBTREELINVEL, G::kSubtree, F::kWorld, "m/s",
     "velocity of the centre of mass of the body's subtree"},
    {"subtreeangmom", mjSENS_SUBTREEANGMOM, G::kSubtree, F::kWorld, "kg m^2/s",
     "angular momentum of the body's subtree about its centre of mass"},
    {"insidesite", mjSENS_INSIDESITE, G::kInside, F::kNone, "",
     "1 if the origin of the object's frame is inside the site, else 0"},
    {"distance", mjSENS_GEOMDIST, G::kGeomPair, F::kNone, "m",
     "smallest signed distance between the surfaces of obj and ref; cutoff where it is larger"},
    {"normal", mjSENS_GEOMNORMAL, G::kGeomPair, F::kWorld, "",
     "unit vector from the surface of obj to that of ref where they are nearest; 0 beyond cutoff"},
    {"fromto", mjSENS_GEOMFROMTO, G::kGeomPair, F::kWorld, "m",
     "segment between the nearest points of obj and ref: two points; 0 beyond cutoff"},
    {"contact", mjSENS_CONTACT, G::kContact, F::kNone, "", "MuJoCo's contact sensor, found in XML"},
    {"e_potential", mjSENS_E_POTENTIAL, G::kWorld, F::kNone, "J", "potential energy of the world"},
    {"e_kinetic", mjSENS_E_KINETIC, G::kWorld, F::kNone, "J", "kinetic energy of the world"},
    {"clock", mjSENS_CLOCK, G::kWorld, F::kNone, "s", "simulation time of the world"},
    {"tactile", mjSENS_TACTILE, G::kTactile, F::kNone, "m, m/s, m/s",
     "for each of N taxels penetration depth >= 0, then N and N tangential sliding speeds >= 0"},
    {"plugin", mjSENS_PLUGIN, G::kPlugin, F::kNone, "", "output of an engine plugin"},
    {"user", mjSENS_USER, G::kUser, F::kNone, "", "what the callback mjcb_sensor writes"},
};

constexpr RangeField kRangeFields[] = {{"dist", 1},  {"dir", 3},    {"origin", 3},
                                       {"point", 3}, {"normal", 3}, {"depth", 1}};
static_assert(std::size(kRangeFields) == mjNRAYDATA);

const std::vector<std::string> kFrames = {"body", "xbody", "geom", "site", "camera"};

}  // namespace

std::span<const BuiltinType> builtin_types() { return kTypes; }
std::span<const RangeField> range_fields() { return kRangeFields; }

const BuiltinType& builtin_type(std::string_view name, std::string_view context) {
  std::vector<std::string> names;
  for (const BuiltinType& type : kTypes) {
    if (type.name == name && type.group != G::kContact) return type;
    if (type.group != G::kContact) names.emplace_back(type.name);
  }
  throw ValueError(std::string(context) + ": unknown sensor_type '" + std::string(name) + "'" +
                   suggest(name, names));
}

const BuiltinType& builtin_type(mjtSensor type) {
  for (const BuiltinType& t : kTypes) {
    if (t.type == type) return t;
  }
  throw RuntimeError("MuJoCo has a sensor type that mjsense does not support: number " +
                     std::to_string(type));
}

std::vector<std::string> allowed_objects(BuiltinGroup group) {
  switch (group) {
    case G::kSite:
    case G::kProjection:
      return {"site"};
    case G::kRangefinder:
      return {"site", "camera"};
    case G::kJoint:
      return {"joint"};
    case G::kTendon:
      return {"tendon"};
    case G::kActuator:
      return {"actuator"};
    case G::kFrame:
    case G::kInside:
      return kFrames;
    case G::kSubtree:
      return {"body"};
    case G::kGeomPair:
      return {"geom", "body"};
    case G::kTactile:
      return {"mesh"};
    default:
      return {};
  }
}

std::vector<std::string> allowed_refs(BuiltinGroup group) {
  switch (group) {
    case G::kFrame:
      return kFrames;
    case G::kProjection:
      return {"camera"};
    case G::kInside:
      return {"site"};
    case G::kGeomPair:
      return {"geom", "body"};
    case G::kTactile:
      return {"geom"};
    default:
      return {};
  }
}

}  // namespace mjsense::scene
