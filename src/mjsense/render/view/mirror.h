// SPDX-License-Identifier: Apache-2.0
#pragma once
// The mirror of a view: the first plane or box that reflects. As in MuJoCo, there is at most one.

namespace mjsense::rays {
struct RayGeom;
}  // namespace mjsense::rays

namespace mjsense::render {

// Searches the geoms for the mirror of a camera, and mirrors the camera in its plane. Its pixel rays
// then meet the mirror at the same points and continue to what is reflected. The camera's rotation
// becomes a reflection, which does no harm.
struct MirrorSearch {
  // position, rotation: X_WC, row-major.
  MirrorSearch(const double position[3], const double rotation[9])
      : camera_position(position), camera_rotation(rotation) {}

  // Returns true if the search is over.
  bool visit(const rays::RayGeom& geom, int geom_id, float alpha, float geom_reflectance);

  const double *camera_position, *camera_rotation;
  int id = -1;  // of the mirror; -1: there is none
  float reflectance = 0;
  double position[3], rotation[9];  // of the mirrored camera
};

}  // namespace mjsense::render
