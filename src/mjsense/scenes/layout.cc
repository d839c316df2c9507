// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mjsense {
namespace {

using std::numbers::pi;

// What an object takes up in a resting orientation.
struct Footprint {
  double radius = 0;  // m, about the vertical through the body's origin
  double low = 0;     // m, its lowest point
};

Footprint footprint(const ObjectShape& shape, Quat rest) {
  Footprint print;
  for (Vec3 point : shape.points) {
    const Vec3 p = rotate(rest, point);
    print.radius = std::max(print.radius, std::hypot(p.x, p.y));
    print.low = std::min(print.low, p.z);
  }
  return print;
}

struct Placed {
  int object, region;
  double x, y, radius;
};

struct Spot {
  double x, y;
};

}  // namespace

void lay_out(std::span<const Resting> objects, std::span<const int> wanted,
             std::span<const char> present, std::span<const Region> regions, const LayoutCfg& cfg,
             Rng& rng, std::span<Pose> poses, std::span<int> region_of) {
  const int n = static_cast<int>(objects.size());
  std::vector<Placed> placed;
  const int target = wanted.empty() ? -1 : wanted[0];
  std::vector<int> order(wanted.begin(), wanted.end());
  for (int object = 0; object < n; ++object) {
    if (std::ranges::count(wanted, object) == 0) order.push_back(object);
  }
  for (int object : order) {
    if (!present[object]) continue;
    const auto many = static_cast<std::uint32_t>(regions.size());
    const int region = many == 1 ? 0 : static_cast<int>(rng.below(many));
    const bool near = std::ranges::count(wanted, object) > 0;
    const Area& area = near ? regions[region].target_area : regions[region].area;
    const Quat rest =
        objects[object].rests[rng.below(static_cast<std::uint32_t>(objects[object].rests.size()))];
    const Footprint print = footprint(*objects[object].shape, rest);
    const auto draw = [&] {
      const double x = rng.uniform(area.x0, area.x1);
      return Spot{x, rng.uniform(area.y0, area.y1)};
    };
    // Metres to spare at a spot: negative where objects would stand too close.
    const auto clearance = [&](Spot s) {
      double least = 1.0;
      for (const Placed& other : placed) {
        if (other.region != region) continue;
        const double gap = object == target || other.object == target ? cfg.target_gap : cfg.gap;
        const double distance = std::hypot(s.x - other.x, s.y - other.y);
        least = std::min(least, distance - print.radius - other.radius - gap);
      }
      return least;
    };
    Spot best = draw();
    double room = clearance(best);
    for (int attempt = 0; attempt < cfg.attempts && room < 0; ++attempt) {
      const Spot spot = draw();
      const double r = clearance(spot);
      if (r > room) {
        room = r;
        best = spot;
      }
    }
    placed.push_back({object, region, best.x, best.y, print.radius});
    const Vec3 position{best.x, best.y, regions[region].height - print.low + cfg.drop};
    region_of[object] = region;
    poses[object] = {position, axis_angle({0, 0, 1}, rng.uniform(-pi, pi)) * rest};
  }
}

}  // namespace mjsense
