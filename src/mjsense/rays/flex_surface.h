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
  // [F, 3] surface vertices, in the order of mjvScene::flexface. Dimension 2: element e has faces 2 e
  // and 2 e + 1, then the border; dimension 3: shell by shell. Dimension 1: none.
  std::vector<int> faces;
  std::vector<int> texcoords;  // [F, 3] into the flex's texture coordinates; empty: it has none
  int num_sheet_faces = 0;     // the faces before the border
  std::vector<int> edges;      // [E, 2] vertices, dimension 1 only
  std::vector<float> rest;     // [num_vertices, 3] m, as the model describes it

  int num_faces() const { return static_cast<int>(faces.size() / 3); }
};

FlexSurface flex_surface(const mjModel* model, int flex);

// Material id, -1: none. MuJoCo may give every element its own; the first one's is taken for all.
int flex_material(const mjModel* model, int flex);

}  // namespace mjsense
