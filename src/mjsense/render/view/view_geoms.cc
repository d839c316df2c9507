// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_geoms.h"

#include <algorithm>

#include "mjsense/render/view/light_frame.h"

namespace mjsense::render {

bool hides_environment(const ViewGeom& g) {
  return g.casts_shadows && !g.transparent && !g.deforms && !g.height_field;
}

void set_primitive(int type, int object, int object_id, ViewGeom& g) {
  g.type = type;
  g.shows_back = type == mjGEOM_PLANE && g.eye[2] < 0;
  g.object_type = object;
  g.object_id = object_id;
  g.bvh = nullptr;
  g.clusters = nullptr;
  g.horizons = nullptr;
  g.mesh = nullptr;
  g.mesh_on_demand = nullptr;
  g.height_field = nullptr;
  g.deforms = false;
}

ViewGeoms::ViewGeoms(std::size_t capacity) : unsorted_(capacity), sorted_(capacity) {
  order_.reserve(capacity);
}

void ViewGeoms::sort(View& view) {
  std::sort(order_.begin(), order_.end(), [](const Order& a, const Order& b) {
    if (a.rank != b.rank) return a.rank < b.rank;
    if (a.key != b.key) return a.key < b.key;
    return a.index < b.index;
  });
  view.num_opaque = view.num_transparent = 0;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    sorted_[i] = unsorted_[order_[i].index];
    view.num_opaque += order_[i].rank == 0;
    view.num_transparent += order_[i].rank == 1;
  }
  view.geoms = sorted_.data();
  view.num_geoms = static_cast<int>(order_.size());
}

void ViewGeoms::set_occluders(View& view) {
  const std::size_t stride = sorted_.size() + kWindowPadding;
  occluder_spheres_.resize(4 * stride);
  float* p = occluder_spheres_.data();
  view.occluders = {p, p + stride, p + 2 * stride, p + 3 * stride};
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& g = sorted_[i];
    for (int k = 0; k < 3; ++k) p[k * stride + i] = g.type == mjGEOM_PLANE ? 0 : g.center[k];
    p[3 * stride + i] = hides_environment(g) ? g.radius + view.physical.occlusion_reach : -1;
  }
}

}  // namespace mjsense::render
