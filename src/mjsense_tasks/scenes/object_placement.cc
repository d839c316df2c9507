// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_placement.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <numeric>
#include <vector>

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

// Space that an object needs in a resting orientation.
struct Footprint {
  double radius = 0;  // m, about the vertical axis through the body's origin
  double low = 0;     // m, its lowest point
};

Footprint footprint(const episode::ObjectShape& shape, Quat rest) {
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

// Places the objects in order, each where there is room among those before it. Returns the distance
// (m) between the closest two circles that are closer than they should be; negative if they
// overlap.
double try_place_objects(std::span<const PlacedObject> objects, std::span<const int> order,
                         std::span<const int> wanted, std::span<const Region> regions,
                         const LayoutCfg& cfg, Rng& rng, std::span<Pose> poses,
                         std::span<int> region_of) {
  std::vector<Placed> placed;
  std::vector<int> all(regions.size()), for_targets;
  std::iota(all.begin(), all.end(), 0);
  std::ranges::copy_if(all, std::back_inserter(for_targets),
                       [&](int region) { return regions[region].for_targets; });
  const int target = wanted.empty() ? -1 : wanted[0];
  double apart = 1.0;
  for (int object : order) {
    const bool near = std::ranges::count(wanted, object) > 0;
    const std::vector<int>& choice = near ? for_targets : all;
    const auto many = static_cast<std::uint32_t>(choice.size());
    const int region = choice[many == 1 ? 0 : rng.below(many)];
    const Area& area = near ? regions[region].target_area : regions[region].area;
    const Quat rest =
        objects[object].rests[rng.below(static_cast<std::uint32_t>(objects[object].rests.size()))];
    const Footprint print = footprint(*objects[object].shape, rest);
    const auto draw = [&] {
      const double x = rng.uniform(area.x0, area.x1);
      return Spot{x, rng.uniform(area.y0, area.y1)};
    };
    // Clearance (m) at a spot, beyond the required gaps or without them.
    const auto clearance = [&](Spot s, bool gaps) {
      double minimum = 1.0;
      for (const Placed& other : placed) {
        if (other.region != region) continue;
        const double gap = object == target || other.object == target ? cfg.target_gap : cfg.gap;
        const double distance = std::hypot(s.x - other.x, s.y - other.y);
        minimum = std::min(minimum, distance - print.radius - other.radius - (gaps ? gap : 0.0));
      }
      return minimum;
    };
    Spot best = draw();
    double room = clearance(best, true);
    for (int attempt = 0; attempt < cfg.attempts && room < 0; ++attempt) {
      const Spot spot = draw();
      const double r = clearance(spot, true);
      if (r > room) {
        room = r;
        best = spot;
      }
    }
    apart = std::min(apart, clearance(best, false));
    placed.push_back({object, region, best.x, best.y, print.radius});
    const Vec3 position{best.x, best.y, regions[region].height - print.low + cfg.drop};
    region_of[object] = region;
    poses[object] = {position, axis_angle({0, 0, 1}, rng.uniform(-pi, pi)) * rest};
  }
  return apart;
}

}  // namespace

void place_objects(std::span<const PlacedObject> objects, std::span<const int> wanted,
                   std::span<const char> present, std::span<const Region> regions,
                   const LayoutCfg& cfg, Rng& rng, std::span<Pose> poses,
                   std::span<int> region_of) {
  std::vector<int> order(wanted.begin(), wanted.end());
  for (int object = 0; object < static_cast<int>(objects.size()); ++object) {
    if (std::ranges::count(wanted, object) == 0) order.push_back(object);
  }
  std::erase_if(order, [&](int object) { return !present[object]; });
  double apart = try_place_objects(objects, order, wanted, regions, cfg, rng, poses, region_of);
  std::vector<Pose> other(poses.begin(), poses.end());
  std::vector<int> other_region(region_of.begin(), region_of.end());
  for (int k = 1; k < cfg.layouts && apart < 0; ++k) {
    const double now =
        try_place_objects(objects, order, wanted, regions, cfg, rng, other, other_region);
    if (now <= apart) continue;
    apart = now;
    std::ranges::copy(other, poses.begin());
    std::ranges::copy(other_region, region_of.begin());
  }
}

}  // namespace mjsense::tasks::scenes
