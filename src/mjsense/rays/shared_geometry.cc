// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/shared_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "mjsense/core/error.h"

namespace mjsense::rays {
namespace {

struct Triangles {
  std::vector<float> vertices;  // [n, 3] m
  std::vector<int> faces;       // [m, 3]
};

// The surface of a height field, cells split along (row, col) - (row + 1, col + 1).
Triangles surface_of(const HeightField& field) {
  Triangles out;
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.cols; ++c) {
      out.vertices.push_back(field.size[0] * (2.0f * c / (field.cols - 1) - 1.0f));
      out.vertices.push_back(field.size[1] * (2.0f * r / (field.rows - 1) - 1.0f));
      out.vertices.push_back(field.size[2] * field.data[r * field.cols + c]);
    }
  for (int r = 0; r + 1 < field.rows; ++r)
    for (int c = 0; c + 1 < field.cols; ++c) {
      const int v = r * field.cols + c;
      for (int i : {v, v + 1, v + field.cols + 1, v, v + field.cols + 1, v + field.cols})
        out.faces.push_back(i);
    }
  return out;
}

float steepest_slope(const HeightField& field) {
  const float dx = 2 * field.size[0] / (field.cols - 1), dy = 2 * field.size[1] / (field.rows - 1);
  float maximum = 0;
  for (int r = 0; r + 1 < field.rows; ++r)
    for (int c = 0; c + 1 < field.cols; ++c) {
      const float *p = field.data + r * field.cols + c, *q = p + field.cols;
      maximum = std::max({maximum, std::hypot((p[1] - p[0]) / dx, (q[1] - p[1]) / dy),
                          std::hypot((q[1] - q[0]) / dx, (q[0] - p[0]) / dy)});
    }
  return maximum * field.size[2];
}

int blocks(int points) { return (points - 2) / HeightField::kBlock + 1; }

std::vector<float> highest_points(const HeightField& field) {
  std::vector<float> tops;
  for (int by = 0; by < blocks(field.rows); ++by) {
    for (int bx = 0; bx < blocks(field.cols); ++bx) {
      // A block includes the grid points on its far border.
      float top = 0.0f;
      for (int r = by * HeightField::kBlock;
           r <= std::min((by + 1) * HeightField::kBlock, field.rows - 1); ++r) {
        const float* row = field.data + r * field.cols;
        for (int c = bx * HeightField::kBlock;
             c <= std::min((bx + 1) * HeightField::kBlock, field.cols - 1); ++c)
          top = std::max(top, row[c]);
      }
      tops.push_back(top * field.size[2]);
    }
  }
  return tops;
}

}  // namespace

SharedGeometry::SharedGeometry(const mjModel* m) {
  device = ray_device();
  // All meshes, including those that no geom uses, because a world may assign another mesh to a
  // geom.
  const bool images = m->ncam > 0;
  for (int i = 0; i < m->nmesh; ++i) {
    const auto count = [](int n) { return 3 * static_cast<std::size_t>(n); };
    const MeshGeometry& made = meshes.emplace_back(
        MeshArrays({m->mesh_vert + count(m->mesh_vertadr[i]), count(m->mesh_vertnum[i])},
                   {m->mesh_face + count(m->mesh_faceadr[i]), count(m->mesh_facenum[i])}),
        images);
    mesh_scenes.push_back(made.scene ? made.scene->scene.get() : nullptr);
    bounds.meshes.push_back(made.box);
  }
  for (int i = 0; i < m->nflex; ++i) flexes.push_back(flex_surface(m, i));
  for (int i = 0; i < m->nhfield; ++i) {
    HeightField field{};
    field.data = m->hfield_data + m->hfield_adr[i];
    field.rows = m->hfield_nrow[i];
    field.cols = m->hfield_ncol[i];
    std::copy_n(m->hfield_size + 4 * i, 4, field.size);
    if (images) {
      const Triangles surface = surface_of(field);
      surfaces.emplace_back(MeshArrays(surface.vertices, surface.faces), images);
      field.scene = surfaces.back().scene->scene.get();
    }
    block_tops.push_back(highest_points(field));
    field.block_tops = block_tops.back().data();
    field.block_cols = blocks(field.cols);
    field.top = *std::max_element(block_tops.back().begin(), block_tops.back().end());
    field.lid = std::max(field.size[2], field.top);
    field.steepest = steepest_slope(field);
    height_fields.push_back(field);
    const float* s = field.size;
    bounds.height_fields.push_back(
        {0, 0, 0.5f * (field.lid - s[3]), s[0], s[1], 0.5f * (field.lid + s[3])});
  }
}

}  // namespace mjsense::rays
