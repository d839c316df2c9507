// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/flex_shapes.h"

#include <algorithm>

namespace mjsense::rays {
namespace {

// Unit normal of the triangle a b c.
void face_normal(const double* a, const double* b, const double* c, double n[3]) {
  double ab[3], ac[3];
  mju_sub3(ab, b, a);
  mju_sub3(ac, c, a);
  mju_cross(n, ab, ac);
  mju_normalize3(n);
}

SceneHandle capsule_scene(RTCDevice device, const std::vector<float>& ends) {
  const std::size_t count = ends.size() / 8;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, ends.data(), 0,
                             4 * sizeof(float), 2 * count);
  auto* first = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(unsigned), count));
  for (std::size_t e = 0; e < count; ++e) first[e] = static_cast<unsigned>(2 * e);
  return moving_scene(device, geometry);
}

}  // namespace

FlexShapes::FlexShapes(RTCDevice device, std::span<const FlexSurface> surfaces,
                       const mjModel* model) {
  flexes_.reserve(surfaces.size());
  for (const FlexSurface& s : surfaces) {
    Flex& flex = flexes_.emplace_back();
    flex.surface = &s;
    flex.radius = model->flex_radius[flexes_.size() - 1];
    flex.vertices.assign(s.rest.begin(), s.rest.end());
    if (s.dim == 1) {
      add_capsules(device, flex);
      continue;
    }
    if (model->ncam > 0) flex.normals.resize(3 * s.faces.size());
    add_sheets(device, flex);
  }
}

void FlexShapes::add_sheets(RTCDevice device, Flex& flex) {
  const FlexSurface& s = *flex.surface;
  std::vector<float> rest = s.rest;
  if (s.dim == 2) rest.insert(rest.end(), s.rest.begin(), s.rest.end());
  flex.smooth.resize(s.rest.size());
  flex.mesh = DeformableMesh(device, s.faces, rest);
  move_sheets(flex);
  scenes_.push_back(flex.mesh.scene());
  for (const FlexSurface::Part& p : s.parts) {
    const std::span<const int> faces(s.faces.data() + 3 * p.first, 3 * p.count);
    void* scene = s.parts.size() == 1 ? scenes_.back() : flex.mesh.add_part(device, faces);
    const float* normals = flex.normals.empty() ? nullptr : flex.normals.data() + 9 * p.first;
    parts_.push_back({static_cast<int>(flexes_.size()) - 1, p.element, -1, scene, normals,
                      flex.mesh.vertices().data(), faces.data()});
  }
}

void FlexShapes::add_capsules(RTCDevice device, Flex& flex) {
  const FlexSurface& s = *flex.surface;
  flex.ends.resize(4 * s.edges.size());
  move_capsules(flex);
  if (!s.edges.empty() && flex.radius > 0) flex.capsules = capsule_scene(device, flex.ends);
  scenes_.push_back(flex.capsules.get());
  for (const FlexSurface::Part& p : s.parts)
    parts_.push_back({static_cast<int>(flexes_.size()) - 1, p.element, -1, scenes_.back(), nullptr,
                      nullptr, nullptr});
}

void FlexShapes::update(const mjModel* m, const mjData* d) {
  for (Part& part : parts_) part.material = m->flex_matid[part.element];
  for (std::size_t f = 0; f < flexes_.size(); ++f) {
    Flex& flex = flexes_[f];
    const double* moved = d->flexvert_xpos + 3 * m->flex_vertadr[f];
    if (flex.radius == m->flex_radius[f] &&
        std::equal(flex.vertices.begin(), flex.vertices.end(), moved))
      continue;
    flex.radius = m->flex_radius[f];
    std::copy_n(moved, flex.vertices.size(), flex.vertices.begin());
    if (flex.surface->dim == 1) {
      move_capsules(flex);
      if (flex.capsules) refit_scene(flex.capsules.get());
    } else {
      move_sheets(flex);
      flex.mesh.refit();
    }
  }
}

void FlexShapes::move_capsules(Flex& flex) {
  const FlexSurface& s = *flex.surface;
  const double* origin = flex.vertices.data();
  const auto radius = static_cast<float>(flex.radius);
  float low[3] = {}, high[3] = {};
  for (std::size_t i = 0; i < s.edges.size(); ++i) {
    float* end = &flex.ends[4 * i];
    for (int k = 0; k < 3; ++k) {
      end[k] = static_cast<float>(origin[3 * s.edges[i] + k] - origin[k]);
      low[k] = std::min(low[k], end[k]);
      high[k] = std::max(high[k], end[k]);
    }
    end[3] = radius;
  }
  for (int k = 0; k < 3; ++k) {
    flex.box[k] = 0.5f * (low[k] + high[k]);
    flex.box[3 + k] = 0.5f * (high[k] - low[k]) + radius;
  }
}

void FlexShapes::move_sheets(Flex& flex) {
  const FlexSurface& s = *flex.surface;
  const double* x = flex.vertices.data();
  std::fill(flex.smooth.begin(), flex.smooth.end(), 0.0);
  for (int f = 0; f < s.num_faces(); ++f) {
    const int* v = &s.faces[3 * f];
    if (s.side(v) != FlexSurface::Side::kFirst) continue;
    double n[3];
    face_normal(x + 3 * v[0], x + 3 * v[1], x + 3 * v[2], n);
    for (int c = 0; c < 3; ++c) mju_addTo3(&flex.smooth[3 * v[c]], n);
  }
  const std::span<float> surface = flex.mesh.vertices();
  for (int i = 0; i < s.num_vertices; ++i) {
    double* n = &flex.smooth[3 * i];
    mju_normalize3(n);
    for (int k = 0; k < 3; ++k) {
      const double p = x[3 * i + k] - x[k];
      surface[3 * i + k] = static_cast<float>(p + flex.radius * n[k]);
      if (s.dim == 2)
        surface[3 * (s.num_vertices + i) + k] = static_cast<float>(p - flex.radius * n[k]);
    }
  }
  box_around(surface, flex.box);
  if (!flex.normals.empty()) shade(flex);
}

// Faces with smooth shading have their vertices' normals, negated in the second sheet. Flat faces
// have the normal of the face before it was displaced by the radius; faces of the border have their
// own.
void FlexShapes::shade(Flex& flex) {
  const FlexSurface& s = *flex.surface;
  const std::span<const float> surface = flex.mesh.vertices();
  for (int f = 0; f < s.num_faces(); ++f) {
    const int* v = &s.faces[3 * f];
    float* out = &flex.normals[9 * f];
    const FlexSurface::Side side = s.side(v);
    const int sheet = side == FlexSurface::Side::kSecond ? s.num_vertices : 0;
    if (!s.flat && side != FlexSurface::Side::kBorder) {
      const double sign = sheet ? -1 : 1;
      for (int c = 0; c < 3; ++c) {
        const double* n = &flex.smooth[3 * (v[c] - sheet)];
        for (int k = 0; k < 3; ++k) out[3 * c + k] = static_cast<float>(sign * n[k]);
      }
      continue;
    }
    double corners[9], n[3];
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k)
        corners[3 * c + k] = side == FlexSurface::Side::kBorder
                                 ? surface[3 * v[c] + k]
                                 : flex.vertices[3 * (v[c] - sheet) + k];
    face_normal(corners, corners + 3, corners + 6, n);
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) out[3 * c + k] = static_cast<float>(n[k]);
  }
}

}  // namespace mjsense::rays
