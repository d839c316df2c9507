// SPDX-License-Identifier: Apache-2.0
#pragma once
// The surface of a flex as MuJoCo draws it, and rays and cameras meet it: what all worlds share.
//   dimension 2   two sheets, `radius` before and behind the triangles along smooth normals of the
//                 vertices, closed along the border
//   dimension 3   the shell, `radius` outside of its vertices
//   dimension 1   a capsule of `radius` for every edge (MuJoCo leaves the joints of its cylinders
//                 open)

#include <mujoco/mujoco.h>

#include <vector>

namespace mjsense {

struct FlexSurface {
  int dim = 0;
  int num_vertices = 0;  // of the flex; surface vertex v + num_vertices is v of the second sheet
  bool flat = false;     // shaded by faces
  // [F, 3] surface vertices. Dimension 2: element e has faces 2 e and 2 e + 1, then comes the
  // border; dimension 3: shell by shell; dimension 1: none. Faces of one material are
  // together, if elements differ in it.
  std::vector<int> faces;
  std::vector<int> texcoords;  // [F, 3] into the flex's texture coordinates; empty: it has none
  std::vector<int> edges;      // [E, 2] vertices, dimension 1 only
  std::vector<float> rest;     // [num_vertices, 3] m, as the model describes it

  // Faces [first, first + count), which share the material of mjModel's element `element`; all
  // edges.
  struct Part {
    int element, first, count;
  };
  std::vector<Part> parts;

  int num_faces() const { return static_cast<int>(faces.size() / 3); }
  // Corners v of a face: all in the first sheet (or shell), all in the second, or between them.
  enum class Side { kFirst, kSecond, kBorder };
  Side side(const int* v) const {
    const int seconds = (v[0] >= num_vertices) + (v[1] >= num_vertices) + (v[2] >= num_vertices);
    return seconds == 0 ? Side::kFirst : seconds == 3 ? Side::kSecond : Side::kBorder;
  }
};

FlexSurface flex_surface(const mjModel* model, int flex);

// All flexes' parts, one after another: a part of what cameras draw for every material.
struct FlexPart {
  int flex, element;
};
std::vector<FlexPart> flex_parts(const mjModel* model);

}  // namespace mjsense
