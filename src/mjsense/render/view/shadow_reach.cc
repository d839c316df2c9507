// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/shadow_reach.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mjsense/rays/box_list.h"
#include "mjsense/rays/ray_world.h"
#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/frustum.h"
#include "mjsense/render/view/soft_lights.h"

namespace mjsense::render {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
constexpr float kPlane = 1e29f;  // m; boxes of planes are larger, others are not

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Bounding box of all objects except planes.
struct Extent {
  double low[3] = {kUnlimited, kUnlimited, kUnlimited},
         high[3] = {-kUnlimited, -kUnlimited, -kUnlimited};

  void add(const rays::KernelBoxes& boxes, int k) {
    for (int i = 0; i < 3; ++i) {
      low[i] = std::min<double>(low[i], boxes.low[i][k]);
      high[i] = std::max<double>(high[i], boxes.high[i][k]);
    }
  }
  double minimum(const double* n) const {
    double sum = 0;
    for (int i = 0; i < 3; ++i) sum += n[i] * (n[i] > 0 ? low[i] : high[i]);
    return sum;
  }
  double maximum(const double* n) const {
    const double away[3] = {-n[0], -n[1], -n[2]};
    return -minimum(away);
  }
  double size() const {
    const double d[3] = {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
    return std::sqrt(dot(d, d));
  }
};

bool is_plane(const rays::KernelBoxes& boxes, int k) { return boxes.high[0][k] > kPlane; }

Extent extent_of(const rays::BoxList& list) {
  Extent out;
  list.each(
      [&](int block) {
        if (is_plane(list.blocks(), block)) return true;  // at least one plane is in the block
        out.add(list.blocks(), block);
        return false;
      },
      [&](int k) {
        if (!is_plane(list.all(), k)) out.add(list.all(), k);
      });
  return out;
}

// Maximum distance between a caster and its shadow in parallel light, on objects and on planes.
double longest_shadow(const rays::RayWorld& world, const Extent& extent,
                      const rays::RayLight& light, const double* to_light) {
  // Objects behind the light cast no shadow; see dark_lanes() of the kernels.
  double longest = std::min(extent.maximum(to_light), dot(light.pos, to_light));
  longest = std::max(longest - extent.minimum(to_light), 0.0);
  const rays::BoxList& boxes = world.boxes();
  const auto add_plane = [&](int k) {
    if (!is_plane(boxes.all(), k)) return;
    const rays::RayGeom& plane = world.geom(boxes.object(k));
    const double n[3] = {plane.mat[2], plane.mat[5], plane.mat[8]};
    const double height = dot(n, plane.pos), slope = std::abs(dot(n, to_light));
    const double away = std::max(extent.maximum(n) - height, height - extent.minimum(n));
    longest = std::max(longest, slope > 0 ? away / slope : kUnlimited);
  };
  boxes.each([&](int block) { return is_plane(boxes.blocks(), block); }, add_plane);
  return longest;
}

}  // namespace

void reach_lights(const rays::RayWorld& world, const Appearance& appearance, int samples,
                  Frustum& frustum) {
  const Extent extent = extent_of(world.boxes());
  if (!(extent.low[0] <= extent.high[0])) return;  // only planes
  bool any = false;
  for (std::size_t i = 0; i < appearance.lights().size(); ++i) {
    const ViewLight& light = appearance.lights()[i];
    const int id = appearance.light_ids()[i];
    if (!light.casts_shadows || id < 0) continue;
    any = true;
    const rays::RayLight& source = world.lights()[id];
    if (light.kind != LightKind::kDirectional) {
      const int count = light_samples(appearance, i, samples);
      for (int k = 0; k < count; ++k) {
        double from[3] = {source.pos[0], source.pos[1], source.pos[2]};
        if (count > 1) sample_position(source.pos, appearance.light_radii()[i], k, count, from);
        frustum.reach(from);
      }
      continue;
    }
    const double length = std::sqrt(dot(source.dir, source.dir));
    double to_light[3];
    for (int k = 0; k < 3; ++k) to_light[k] = -source.dir[k] / length;
    frustum.reach(to_light, longest_shadow(world, extent, source, to_light));
  }
  // Shadow rays start slightly above triangles: 1e-4 of the size of the shape.
  if (any) frustum.widen(1e-3 * extent.size());
}

}  // namespace mjsense::render
