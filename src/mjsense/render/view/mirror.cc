// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/mirror.h"

#include <mujoco/mujoco.h>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/view/geom_surface.h"

namespace mjsense::render {

bool MirrorSearch::visit(const rays::RayGeom& g, int geom_id, float alpha, float geom_reflectance) {
  if (g.type != mjGEOM_PLANE && g.type != mjGEOM_BOX) return false;
  if (geom_reflectance <= 0 || alpha < kOpaque) return false;
  const double normal[3] = {g.mat[2], g.mat[5], g.mat[8]};
  const double top = g.type == mjGEOM_BOX ? g.size[2] : 0;
  double above = -top;
  for (int k = 0; k < 3; ++k) above += (camera_position[k] - g.pos[k]) * normal[k];
  // Below a mirror: a box ends the search; a plane, which is drawn as a veil, is skipped.
  if (above < 0) return g.type == mjGEOM_BOX;
  for (int k = 0; k < 3; ++k) position[k] = camera_position[k] - 2 * above * normal[k];
  for (int j = 0; j < 3; ++j) {
    double along = 0;
    for (int k = 0; k < 3; ++k) along += normal[k] * camera_rotation[3 * k + j];
    for (int k = 0; k < 3; ++k)
      rotation[3 * k + j] = camera_rotation[3 * k + j] - 2 * along * normal[k];
  }
  id = geom_id;
  reflectance = geom_reflectance;
  return true;
}

}  // namespace mjsense::render
