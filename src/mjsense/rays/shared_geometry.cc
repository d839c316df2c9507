// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/shared_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

std::array<float, 6> box_around(const float* vertices, int count) {
  std::array<float, 6> box{};
  for (int k = 0; k < 3; ++k) {
    float low = std::numeric_limits<float>::infinity(), high = -low;
    for (int i = 0; i < count; ++i) {
      low = std::min(low, vertices[3 * i + k]);
      high = std::max(high, vertices[3 * i + k]);
    }
    box[k] = 0.5f * (low + high);
    box[3 + k] = 0.5f * (high - low);
  }
  return box;
}

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
  float most = 0;
  for (int r = 0; r + 1 < field.rows; ++r)
    for (int c = 0; c + 1 < field.cols; ++c) {
      const float *p = field.data + r * field.cols + c, *q = p + field.cols;
      most = std::max({most, std::hypot((p[1] - p[0]) / dx, (q[1] - p[1]) / dy),
                       std::hypot((q[1] - q[0]) / dx, (q[0] - p[0]) / dy)});
    }
  return most * field.size[2];
}

int blocks(int points) { return (points - 2) / HeightField::kBlock + 1; }

std::vector<float> highest_points(const HeightField& field) {
  std::vector<float> tops;
  for (int by = 0; by < blocks(field.rows); ++by) {
    for (int bx = 0; bx < blocks(field.cols); ++bx) {
      // A block's cells have points on its far border too.
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

SceneHandle build_triangles(RTCDevice device, const float* vertices, int num_vertices,
                            const int* faces, int num_faces) {
  SceneHandle scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), kSceneFlags);
  rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_HIGH);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* v = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                    3 * sizeof(float), num_vertices);
  void* f = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                    3 * sizeof(int), num_faces);
  if (v == nullptr || f == nullptr)
    throw RuntimeError(
        fmt::format("ray scene: Embree could not allocate a mesh of {} vertices and {} faces",
                    num_vertices, num_faces));
  std::copy_n(vertices, 3 * num_vertices, static_cast<float*>(v));
  std::copy_n(faces, 3 * num_faces, static_cast<int*>(f));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  return scene;
}

SharedGeometry::SharedGeometry(const mjModel* m) {
  // One thread: the BVH, and with it every answer, is the same on every machine.
  device.reset(rtcNewDevice("threads=1"));
  if (!device)
    throw RuntimeError(fmt::format("ray scene: Embree gave no device (error {})",
                                   static_cast<int>(rtcGetDeviceError(nullptr))));

  // All meshes, shown or not: a world may give a geom another one.
  meshes.resize(m->nmesh);
  mesh_scenes.assign(m->nmesh, nullptr);
  mesh_clusters.resize(m->nmesh);
  for (int i = 0; i < m->nmesh; ++i) {
    const float* vertices = m->mesh_vert + 3 * m->mesh_vertadr[i];
    bounds.meshes.push_back(box_around(vertices, m->mesh_vertnum[i]));
    if (m->mesh_facenum[i] == 0) continue;
    meshes[i] = build_triangles(device.get(), vertices, m->mesh_vertnum[i],
                                m->mesh_face + 3 * m->mesh_faceadr[i], m->mesh_facenum[i]);
    mesh_scenes[i] = meshes[i].get();
    if (m->ncam > 0)
      mesh_clusters[i] =
          build_clusters(vertices, m->mesh_face + 3 * m->mesh_faceadr[i], m->mesh_facenum[i]);
  }
  for (int i = 0; i < m->nflex; ++i) flexes.push_back(flex_surface(m, i));
  for (int i = 0; i < m->nhfield; ++i) {
    HeightField field{};
    field.data = m->hfield_data + m->hfield_adr[i];
    field.rows = m->hfield_nrow[i];
    field.cols = m->hfield_ncol[i];
    std::copy_n(m->hfield_size + 4 * i, 4, field.size);
    if (m->ncam > 0) {
      const Triangles surface = surface_of(field);
      const int count = static_cast<int>(surface.faces.size() / 3);
      surfaces.push_back(build_triangles(device.get(), surface.vertices.data(),
                                         field.rows * field.cols, surface.faces.data(), count));
      field.scene = surfaces.back().get();
      surface_clusters.push_back(
          build_clusters(surface.vertices.data(), surface.faces.data(), count));
    }
    block_tops.push_back(highest_points(field));
    field.block_tops = block_tops.back().data();
    field.block_cols = blocks(field.cols);
    field.top = *std::max_element(block_tops.back().begin(), block_tops.back().end());
    field.steepest = steepest_slope(field);
    height_fields.push_back(field);
    const float* s = field.size;
    bounds.height_fields.push_back({0, 0, 0.5f * (s[2] - s[3]), s[0], s[1], 0.5f * (s[2] + s[3])});
  }
}

}  // namespace mjsense
