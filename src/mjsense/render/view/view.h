// SPDX-License-Identifier: Apache-2.0
#pragma once
// Input of the render kernels for one image: everything it can show, in the camera's frame (x
// right, y up, looking along -z), where rays start at the origin and single precision is
// sufficient.
//
// The structures that kernels read, here and in the headers below, consist of plain members. Kernels
// are compiled once for each instruction set: an inline function of theirs, such as those of
// std::span, could be compiled for AVX-512 and then be used by the linker in code for all CPUs.
// They own no memory; ViewBuilder owns it.

#include "mjsense/render/view/image_targets.h"
#include "mjsense/render/view/light_frame.h"
#include "mjsense/render/view/physical_view.h"
#include "mjsense/render/view/pixel_grid.h"
#include "mjsense/render/view/view_geom.h"
#include "mjsense/render/view/view_light.h"
#include "mjsense/render/view/warp_look.h"

namespace mjsense::render {

// OpenGL's linear fog: its density is 0 at planar depth `start` (m) and grows with `slope` (1/m)
// to 1.
struct Fog {
  float start = 0, slope = 0;  // slope 0: no fog
  float rgb[3] = {};

  bool operator==(const Fog&) const = default;
};

// Haze over an infinite plane, in front of the skybox.
struct Haze {
  float up[3] = {};  // normal of the plane, unit, camera frame
  float height = 0;  // height of the camera above the plane, m; not positive: no haze
  float width = 0;   // relative to View::sky_distance
  float rgb[3] = {};

  bool operator==(const Haze&) const = default;
};

// mujoco_warp's light model (warp_shading.h) instead of MuJoCo's classic one.
struct WarpLight {
  bool on = false;
  float ambient[3] = {};  // of all lights together, which neither distance nor shadows reduce
  float share_in_shadow = kWarpShareInShadow;

  bool operator==(const WarpLight&) const = default;
};

struct View {
  PixelGrid grid;
  float near = 0, far = 0;  // clip planes, planar depth, m; far 0: no limit
  // [num_geoms]: num_opaque visible opaque geoms, nearest first; then num_transparent visible
  // transparent ones, in MuJoCo's blending order; then geoms that only cast shadows.
  const ViewGeom* geoms = nullptr;
  int num_geoms = 0;
  int num_opaque = 0;
  int num_transparent = 0;
  ViewLight lights[kMaxLights];          // [num_lights]
  LightFrames light_frames[kMaxLights];  // [num_lights]
  FacingSides facing_sides[kMaxLights];  // [num_lights], for lights with frames
  int num_lights = 0;
  bool shadows = false;
  PhysicalView physical;
  WarpLight warp;
  OccluderBoxes occluders;
  bool layered = false;                    // fixed geoms are drawn first
  const FixedTile* fixed_tiles = nullptr;  // by tile: their cached image; null: not cached
  // By ViewGeom::id: index in `geoms`, for visible geoms. Null if the view is not layered.
  const int* geom_index = nullptr;
  bool shows_plane_backs = false;  // depth and segmentation include planes seen from their back
  float global_ambient = 0;
  const Texture* skybox = nullptr;  // null: none
  float r_wc[9] = {};               // R_WC, row-major, W: world frame; for the skybox
  // The skybox is a cylinder around the camera that hides geoms beyond it, as in MuJoCo.
  float sky_distance = 0;  // its radius, m; 0: it hides nothing
  Haze haze;
  float sky_min_depth = 0;   // m; points with a smaller planar depth are neither hidden nor hazy
  Fog fog;                   // over surfaces, haze and skybox
  float sky_fog_radius = 0;  // m; the skybox is as deep in the fog as a cylinder of this radius
  // ViewGeom::id of the first geom that reflects, visible or not; -1 if there is none. The reflected
  // view is that of the camera mirrored in its plane; it is added to the geom's own colour.
  int mirror_id = -1;
  const View* reflection = nullptr;  // null without a mirror
};

}  // namespace mjsense::render
