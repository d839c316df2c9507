// SPDX-License-Identifier: Apache-2.0
#pragma once
// Image spaces of lights, in which geoms are tested before a shadow ray is cast: a geom can only
// shadow a point if it covers the same position in the light's image and is nearer to the light.
//
// Arrays "by geom" have one entry for each of View::geoms, and kWindowPadding more entries that
// kernels may read, because they read whole vectors.

namespace mjsense::render {

inline constexpr int kWindowPadding = 16;

// Position error relative to distance, for the rounding of rays and intersection tests.
inline constexpr float kLightError = 1e-5f;

// Bounds of boxes in a light's image. Each member is an array: a box has u in [u_min, u_max], v in
// [v_min, v_max] and w >= w_min.
struct LightWindows {
  float *u_min, *u_max, *v_min, *v_max, *w_min;
};

// u, v and w of a point are the components of its offset from the origin along the axes; w points
// away from the light. If `perspective`, u and v are divided by w.
struct LightFrame {
  float origin[3];   // camera frame, m; the camera's own origin for directional lights
  float axes[3][3];  // unit vectors of u, v and w, camera frame
  bool perspective;
  float limit;  // the light does not reach points with |u| or |v| above it
  // By geom; infinite for planes and for geoms that reach behind the light.
  LightWindows windows;
};

// The frames of a light: one, or six for a light that shines in all directions, towards
// +x -x +y -y +z -z of the camera's frame. None if it casts no shadows.
struct LightFrames {
  const LightFrame* first = nullptr;
  int count = 0;
};

// The one of the light's frames that serves the points in a box (camera frame, m).
const LightFrame& frame_towards(const LightFrames& frames, const float low[3], const float high[3]);

// Sides of geoms' bounding boxes that face a light, at most one of each opposite pair. A geom does
// not shadow points beyond such a side, which have normal . x > offset.
struct FacingSides {
  float* normal[3][3];  // [k][i]: by geom, component i of the normal of the side along box axis k
  // [k]: by geom, m, including a margin for rounding; infinite for planes, and if neither side
  // along box axis k faces the light.
  float* offset[3];
};

}  // namespace mjsense::render
