// SPDX-License-Identifier: Apache-2.0
#pragma once
// The frame that rays are attached to: a body, site, geom or camera of the model.

#include <mujoco/mujoco.h>

#include <array>
#include <string_view>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/scene/entity.h"

namespace mjsense::scene {
class Scene;
}  // namespace mjsense::scene

namespace mjsense::sensors {

enum class RayAlignment {
  kBase,   // rays rotate with the frame
  kYaw,    // rays rotate with the frame's heading only
  kWorld,  // rays do not rotate
};
constexpr std::array<std::string_view, 3> enum_names(RayAlignment) {
  return {"base", "yaw", "world"};
}

// Pose of a frame F, and the rotation of its rays.
struct FramePose {
  double pos[3];   // m, p_WF
  double mat[9];   // row-major R_WF
  float align[9];  // row-major A: origin = pos + A offset, direction = A direction
};

// Throws ValueError unless `ref` has a name and a type that can carry rays.
void validate_frame(const scene::ObjRef& ref, std::string_view context);

class RayFrame {
 public:
  // `ref` may name a body or xbody (both are the body's own frame, not its inertial one), a site, a
  // geom or a camera.
  RayFrame(const mjModel* model, const scene::Scene* scene, const scene::ObjRef& ref,
           std::string_view context);

  int body() const { return body_; }
  FramePose pose(const mjData* data, RayAlignment alignment) const;

 private:
  mjtObj type_;
  int id_;
  int body_;
};

// R for base, identity for world. For yaw it is the rotation about z that takes x to the direction
// of R's x axis in the xy plane; if that is too short, R's y axis is used. The rays of a body on
// its back therefore still point down.
void align_rays(RayAlignment alignment, const double mat[9], float out[9]);

}  // namespace mjsense::sensors
