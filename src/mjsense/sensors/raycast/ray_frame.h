// SPDX-License-Identifier: Apache-2.0
#pragma once
// The frame that rays are attached to: a body, site, geom or camera of the model.

#include <mujoco/mujoco.h>

#include <string_view>

#include "mjsense/scene/entity.h"

namespace mjsense {

class Scene;

enum class RayAlignment {
  kBase,   // rays turn with the frame
  kYaw,    // with its heading only
  kWorld,  // not at all
};

template <>
inline constexpr std::array<std::string_view, 3> kWords<RayAlignment>{"base", "yaw", "world"};

// Pose of a frame F and the rotation that its rays get.
struct FramePose {
  double pos[3];   // m, p_WF
  double mat[9];   // row-major R_WF
  float align[9];  // row-major A: origin = pos + A offset, direction = A direction
};

// Throws ValueError unless `ref` is of a type that may carry rays, and has a name.
void validate_frame(const ObjRef& ref, std::string_view place);

class RayFrame {
 public:
  // `ref` may name a body, xbody (both the body's own frame, not its inertial one), site, geom or
  // camera.
  RayFrame(const mjModel* model, const Scene* scene, const ObjRef& ref, std::string_view place);

  int body() const { return body_; }
  FramePose pose(const mjData* data, RayAlignment alignment) const;

 private:
  mjtObj type_;
  int id_;
  int body_;
};

// R for base, identity for world; for yaw the rotation about z that takes x to R's x axis in the xy
// plane (where that is too short, its y axis decides), so that a body on its back keeps rays that
// point down.
void align_rays(RayAlignment alignment, const double mat[9], float out[9]);

}  // namespace mjsense
