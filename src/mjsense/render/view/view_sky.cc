// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_sky.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/view/camera_axes.h"

namespace mjsense::render {
namespace {

// A colour of the sky as the kernels need it: radiance, if the view is physically based.
float shown(float color, const PhysicalView& physical) {
  return physical.on ? static_cast<float>(srgb_decode(color)) * physical.unit : color;
}

// The sky's cylinder and the haze are at least (1 - width) times the cylinder's radius away; the
// longest rays go through the image's corners.
float sky_min_depth(const PixelGrid& grid, const Sky& sky) {
  if (grid.distorted_rays) return 0;
  const float x = std::max(std::abs(grid.left), std::abs(grid.left + grid.dx * grid.width));
  const float y = std::max(std::abs(grid.top), std::abs(grid.top + grid.dy * grid.height));
  return std::max(1 - sky.haze_width, 0.0f) * sky.distance / std::sqrt(1 + x * x + y * y);
}

}  // namespace

bool is_endless(const rays::RayGeom& geom) {
  return geom.type == mjGEOM_PLANE && geom.size[0] == 0 && geom.size[1] == 0;
}

void set_sky(const rays::RayGeom* plane, const Sky& sky, const double position[3],
             const double rotation[9], View& view) {
  // An orthographic view has no position relative to the sky: the sky hides nothing and there is no
  // haze.
  view.sky_distance = view.grid.orthographic ? 0 : sky.distance;
  view.sky_min_depth = sky_min_depth(view.grid, sky);
  Haze& haze = view.haze;
  haze.height = 0;
  if (!plane) return;
  const double normal[3] = {plane->mat[2], plane->mat[5], plane->mat[8]};
  double up[3], height = 0;
  rotate_back(rotation, normal, up);
  for (int k = 0; k < 3; ++k) {
    height += (position[k] - plane->pos[k]) * normal[k];
    haze.up[k] = static_cast<float>(up[k]);
    haze.rgb[k] = shown(sky.haze_rgb[k], view.physical);
  }
  haze.height = static_cast<float>(height);
  haze.width = sky.haze_width;
}

void set_fog(const Fog& fog, View& view) {
  view.fog = fog;
  for (float& x : view.fog.rgb) x = shown(x, view.physical);
}

}  // namespace mjsense::render
