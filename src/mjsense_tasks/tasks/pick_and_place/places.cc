// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick_and_place/places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/tasks/pick_and_place/support_check.h"

namespace mjsense::tasks {
namespace {

constexpr double kBesideGap = 0.03;  // m, gap that a planner aims at if no drawn place is free
constexpr double kMinGap = 0.02, kMaxGap = 0.04;  // m, of the drawn places next to an object
constexpr double kAlong = 0.5;  // drawn shift along the other object, as a share of its half size
constexpr double kAround = 0.012;  // m, radius of surface points considered for a placement
// Drawn places, at most, and how many points of the receptacle are drawn for them.
constexpr int kMaxPlaces = 8, kMaxDraws = 32;
constexpr double kUneven = 0.008;  // m, maximum difference in height below an object
constexpr double kCell = 0.008;    // m, twice the distance of the surface points
constexpr int kMaxCells = 6;       // along each side of an object

// The upper surface of a receptacle: its bottom if it is open, otherwise its rim.
class Surface {
 public:
  Surface(std::span<const Vec3> points, const Pose& pose) {
    for (Vec3 point : points) points_.push_back(pose * point);
  }

  // -infinity if there are no points near (x, y).
  double height(double x, double y) const {
    double top = -std::numeric_limits<double>::infinity();
    for (Vec3 p : points_) {
      // The first comparison skips distant points early. A plan evaluates this thousands of times.
      const double dx = p.x - x, dy = p.y - y;
      if (std::abs(dx) < kAround && dx * dx + dy * dy < kAround * kAround) top = std::max(top, p.z);
    }
    return top;
  }

  // Height at which an object with these half extents rests at (x, y); NaN if not all of the surface
  // below its box is level, such as on a rim. The box is divided into cells, in each of which the
  // surface has points.
  double rest(double x, double y, Vec3 half) const {
    const int nx = std::clamp(static_cast<int>(2 * half.x / kCell), 1, kMaxCells);
    const int ny = std::clamp(static_cast<int>(2 * half.y / kCell), 1, kMaxCells);
    std::array<double, kMaxCells * kMaxCells> tops;
    tops.fill(-std::numeric_limits<double>::infinity());
    double top = tops[0];
    for (Vec3 p : points_) {
      const double dx = p.x - x, dy = p.y - y;
      if (!(std::abs(dx) < half.x && std::abs(dy) < half.y)) continue;
      const int i = static_cast<int>(0.5 * (dx / half.x + 1) * nx);
      const int j = static_cast<int>(0.5 * (dy / half.y + 1) * ny);
      double& of_cell = tops[std::min(i, nx - 1) * ny + std::min(j, ny - 1)];
      of_cell = std::max(of_cell, p.z);
      top = std::max(top, p.z);
    }
    const double low = *std::min_element(tops.begin(), tops.begin() + nx * ny);
    return top - low <= kUneven ? top : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  std::vector<Vec3> points_;  // world frame
};

Vec3 half_size(const PlaceQuery& query) {
  return 0.5 * turned_box(query.world, query.object, query.turn).size();
}

}  // namespace

void places_beside(PlaceQuery query, int base_body, std::vector<Vec3>& out) {
  const World& world = query.world;
  const Aabb box = world_box(world, query.receptacle);
  const Vec3 c = box.center(), half_other = 0.5 * box.size();
  const Vec3 half = half_size(query);
  const Vec3 both = half + half_other;
  for (int k = 0; k < kMaxPlaces; ++k) {
    const bool of_x = query.rng.below(2) == 0;
    const double gap = query.rng.uniform(kMinGap, kMaxGap), side = query.rng.below(2) == 0 ? 1 : -1;
    const double along = query.rng.uniform(-kAlong, kAlong);
    out.push_back(of_x ? Vec3{c.x + side * (both.x + gap), c.y + along * half_other.y, box.low.z}
                       : Vec3{c.x + along * half_other.x, c.y + side * (both.y + gap), box.low.z});
  }
  const double x = both.x + kBesideGap, y = both.y + kBesideGap;
  for (double along : {0.0, 0.02, -0.02}) {
    for (int side = -1; side <= 1; side += 2) {
      out.push_back({c.x + along, c.y + side * y, box.low.z});
      out.push_back({c.x + side * x, c.y + along, box.low.z});
    }
  }
  const Vec3 base = vec3(world.data->xpos + 3 * base_body);
  std::stable_sort(out.begin() + kMaxPlaces, out.end(), [&](Vec3 a, Vec3 b) {
    return std::hypot(a.x - base.x, a.y - base.y) < std::hypot(b.x - base.x, b.y - base.y);
  });
  // Remove placements beyond the edge of the supporting surface, such as on the robot's pedestal
  // next to the table: there the two objects would not be on the same surface.
  const int carrier = supporting_body(world, query.receptacle);
  std::erase_if(out, [&](Vec3 p) {
    return carrier >= 0 && !is_supported_over_whole_area(world, p, half, carrier, query.object);
  });
}

void places_within(PlaceQuery query, std::span<const Vec3> points, std::vector<Vec3>& out) {
  const Aabb box = world_box(query.world, query.receptacle);
  const Vec3 c = box.center(), half = half_size(query);
  const Surface surface(points, body_pose(query.world.data, query.receptacle));
  for (int k = 0; k < kMaxDraws && static_cast<int>(out.size()) < kMaxPlaces; ++k) {
    const double x = query.rng.uniform(box.low.x, box.high.x),
                 y = query.rng.uniform(box.low.y, box.high.y);
    const double z = surface.rest(x, y, half);
    if (std::isfinite(z)) out.push_back({x, y, z});
  }
  for (double radius : {0.0, 0.02, 0.04}) {
    for (int k = 0; k < (radius > 0 ? 6 : 1); ++k) {
      const double angle = k * std::numbers::pi / 3;
      const double x = c.x + radius * std::cos(angle), y = c.y + radius * std::sin(angle);
      const double z = surface.height(x, y);
      if (std::isfinite(z)) out.push_back({x, y, z});
    }
  }
  out.push_back({c.x, c.y, box.high.z});
}

}  // namespace mjsense::tasks
