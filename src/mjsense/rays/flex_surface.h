// SPDX-License-Identifier: Apache-2.0
#pragma once
// The surface of a flex as MuJoCo draws it. Rays and cameras both use it. This file holds the part
// that all worlds share.
//   dimension 2   two sheets, offset by `radius` to both sides of the triangles along the smooth
//                 vertex normals, closed along the border
//   dimension 3   the shell, offset outward by `radius`
//   dimension 1   a capsule of `radius` for every edge (MuJoCo draws cylinders with open joints)

#include <mujoco/mujoco.h>

#include <vector>

namespace mjsense::rays {

struct FlexSurface {
  int dim = 0;
  int num_vertices = 0;  // of the flex; surface vertex v + num_vertices is v in the second sheet
  bool flat = false;     // flat shading: one normal per face
  // [F, 3] surface vertices. Dimension 2: element e has faces 2 e and 2 e + 1; the border's faces
  // follow. Dimension 3: the triangles of mjModel's flex_shell, in order. Dimension 1: empty. If
  // elements differ in material, the faces of each material are contiguous.
  std::vector<int> faces;
  std::vector<int> texcoords;  // [F, 3] indices into the flex's texture coordinates, or empty
  std::vector<int> edges;      // [E, 2] vertices, for dimension 1 only
  std::vector<float> rest;     // [num_vertices, 3] m, rest positions of the model

  // Faces [first, first + count), which have the material of mjModel's element `element`. For
  // dimension 1 the part has all edges.
  struct Part {
    int element, first, count;
  };
  std::vector<Part> parts;

  int num_faces() const { return static_cast<int>(faces.size() / 3); }
  // Where the corners v of a face are: all in the first sheet (or shell), all in the second sheet,
  // or in both (the border).
  enum class Side { kFirst, kSecond, kBorder };
  Side side(const int* v) const {
    const int seconds = (v[0] >= num_vertices) + (v[1] >= num_vertices) + (v[2] >= num_vertices);
    return seconds == 0 ? Side::kFirst : seconds == 3 ? Side::kSecond : Side::kBorder;
  }
};

FlexSurface flex_surface(const mjModel* model, int flex);

// The parts of all flexes, one after another; cameras draw one part per material.
struct FlexPart {
  int flex, element;
};
std::vector<FlexPart> flex_parts(const mjModel* model);

}  // namespace mjsense::rays
