// SPDX-License-Identifier: Apache-2.0
#pragma once
// The geoms of a view, in the order in which they are drawn.

#include <mujoco/mujoco.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/view/camera_axes.h"
#include "mjsense/render/view/geom_surface.h"
#include "mjsense/render/view/image_window.h"
#include "mjsense/render/view/view.h"

namespace mjsense::render {

// Allocates nothing after it is made.
class ViewGeoms {
 public:
  explicit ViewGeoms(std::size_t capacity);

  std::size_t capacity() const { return unsorted_.size(); }
  void clear() { order_.clear(); }
  // The next geom, with its pose and size in the camera's frame. The caller sets its shape, then calls
  // add(). position, rotation: X_WC, row-major.
  ViewGeom& place(const rays::RayGeom& source, int id, const double position[3],
                  const double rotation[9]);
  // Sets its surface and adds it, unless the view cannot depend on it.
  void add(const View& view, const SurfaceStyle& style, const rays::RayGeom& source,
           const Paint& paint);
  // Sets the geoms of `view`.
  void sort(View& view);
  // Sets those that hide others from the environment. Call after sort().
  void set_occluders(View& view);

 private:
  struct Order {
    int rank;  // 0 opaque, 1 transparent, 2 only casts shadows
    float key;
    int index;
  };
  std::vector<ViewGeom> unsorted_, sorted_;
  std::vector<Order> order_;
  std::vector<float> occluder_boxes_;
};

// Sets the fields of shapes that are defined by their sizes alone.
void set_primitive(int type, int object, int object_id, ViewGeom& g);

// The functions for each geom of each world are inline.
inline ViewGeom& ViewGeoms::place(const rays::RayGeom& source, int id, const double position[3],
                                  const double rotation[9]) {
  ViewGeom& g = unsorted_[order_.size()];
  g.id = id;
  g.fixed = false;
  const double offset[3] = {source.pos[0] - position[0], source.pos[1] - position[1],
                            source.pos[2] - position[2]};
  double p[3], eye[3];
  rotate_back(rotation, offset, p);
  rotate_back(source.mat, offset, eye);
  for (int i = 0; i < 3; ++i) {
    g.pos[i] = static_cast<float>(p[i]);
    g.eye[i] = static_cast<float>(-eye[i]);
    g.size[i] = source.size[i];
    g.aabb[i] = source.center[i];
    g.aabb[3 + i] = source.half[i];
    for (int j = 0; j < 3; ++j)
      g.rot[3 * i + j] =
          static_cast<float>(rotation[i] * source.mat[j] + rotation[3 + i] * source.mat[3 + j] +
                             rotation[6 + i] * source.mat[6 + j]);
  }
  return g;
}

inline void ViewGeoms::add(const View& view, const SurfaceStyle& style, const rays::RayGeom& source,
                           const Paint& paint) {
  const int index = static_cast<int>(order_.size());
  ViewGeom& g = unsorted_[index];
  const bool hidden = view.warp.on && g.shows_back;  // not a veil, as in MuJoCo
  const bool sight = find_window(view, g) && paint.rgba[3] > 0 && !hidden;
  if (!sight && !view.shadows && !(view.physical.occlusion_reach > 0) && !view.physical.all_geoms)
    return;
  set_surface(style, source, paint, g);
  Order order{sight ? g.transparent : 2, g.min_depth, index};
  if (order.rank == 1) {
    const float* p = g.pos;
    const bool soft = g.object_type == mjOBJ_FLEX || g.object_type == mjOBJ_SKIN;
    const float reach = soft ? 0 : g.radius;  // as in MuJoCo
    order.key =
        g.type == mjGEOM_PLANE ? 1e10f : std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - reach;
  }
  order_.push_back(order);
}

}  // namespace mjsense::render
