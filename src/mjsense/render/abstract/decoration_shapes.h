// SPDX-License-Identifier: Apache-2.0
#pragma once
// Decoration geoms that have no primitive of their own, as triangles: arrows, triangles and lines.

#include <memory>
#include <vector>

#include "mjsense/rays/mesh_geometry.h"
#include "mjsense/render/view/surface_assets.h"

namespace mjsense::render {

struct ShapeTriangles {
  std::vector<float> vertices;  // [V, 3] m, geom frame
  std::vector<int> faces;       // [F, 3]
  std::vector<float> normals;   // [F, 3 corners, 3]; zero: not lit

  struct Corner {
    const float *position, *normal;
  };
  void add(Corner a, Corner b, Corner c);
};

// The arrow of mjvGeom type mjGEOM_ARROW, _ARROW1 (head as wide as the shaft) or _ARROW2 (a head at
// both ends), with the geom's size.
ShapeTriangles arrow_triangles(int type, const float size[3]);

// Both sides of mjGEOM_TRIANGLE, relative to the geom's position, along the axes of the world. In
// the frustums of cameras, the columns of `mat` are unit vectors that are not perpendicular.
ShapeTriangles triangle_triangles(const float size[3], const float mat[9]);

// A line from `from` to `to` as a strip that faces the camera at `eye` (m, geom frame) and is
// `width` pixels wide. `pixel`: size of a pixel at distance 1 m from the eye, or of every pixel if
// the camera is orthographic, which looks along `ahead`.
void add_line(const float from[3], const float to[3], const float eye[3], const float ahead[3],
              bool orthographic, float width, float pixel, ShapeTriangles& out);

}  // namespace mjsense::render
