// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_geoms.h"

#include <algorithm>
#include <numbers>

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
  using Boxes = OccluderBoxes;
  const std::size_t stride = sorted_.size() + kWindowPadding;
  occluder_boxes_.resize(Boxes::kRows * stride);
  view.occluders = {occluder_boxes_.data(), stride};
  const auto set = [&](int row, int i, float value) { view.occluders.row(row)[i] = value; };
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& g = sorted_[i];
    const bool plane = g.type == mjGEOM_PLANE, box = g.type == mjGEOM_BOX;
    const float* half = g.aabb + 3;
    const float radius = plane || box ? 0 : std::min({half[0], half[1], half[2]});
    for (int k = 0; k < 9; ++k) set(Boxes::kRotation + k, i, g.rot[k]);
    for (int k = 0; k < 3; ++k) {
      const float side = k == 2 ? 0 : g.size[k] > 0 ? g.size[k] : kEndless;  // of a plane
      set(Boxes::kOrigin + k, i, g.eye[k] - (plane ? 0 : g.aabb[k]));
      set(Boxes::kHalf + k, i, plane ? side : half[k] - radius);
    }
    set(Boxes::kRadius, i, radius);
    const float reach = hiding_reach(g, view.physical.occlusion_reach);
    set(Boxes::kFade, i, 1 / (reach * reach));
    // At most three faces of a box are seen. The cosines of a hemisphere have the integral pi.
    const float faces = 4 * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0]);
    const float area = plane ? kEndless : box ? faces / std::numbers::pi_v<float> : radius * radius;
    set(Boxes::kArea, i, hides_environment(g) ? area : 0);
    const std::array<float, 3> color = mean_color(g.surface);
    for (int c = 0; c < 3; ++c) set(Boxes::kColor + c, i, color[c]);
  }
}

}  // namespace mjsense::render
