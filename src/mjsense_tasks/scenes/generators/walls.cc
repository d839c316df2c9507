// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/walls.h"

#include <algorithm>
#include <cmath>

namespace mjsense::tasks::scenes {
namespace {

constexpr double kSkirting = 0.08, kBoard = 0.007;  // m, height and half thickness

}  // namespace

void write_wall(RoomWriter& out, Vec3 from, Vec3 to, std::vector<Opening> openings) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  constexpr double half = 0.5 * kWallThickness;
  RoomWriter::Local local(out, "", from, std::atan2(to.y - from.y, to.x - from.x));
  std::ranges::sort(openings, {}, &Opening::from);
  // Two slabs, back to back, because a slab has its texture on one side only.
  const auto piece = [&](double a, double b, double low, double high) {
    if (b - a < 1e-6 || high - low < 1e-6) return;
    const double x = 0.5 * (a + b), z = 0.5 * (low + high);
    out.slab(Facing::kMinusY, {x, -half, z}, b - a, high - low, half, "wall");
    out.slab(Facing::kPlusY, {x, half, z}, b - a, high - low, half, "wall");
    if (low > 0) return;
    for (const double side : {-1.0, 1.0})
      out.box({x, side * (half + kBoard), 0.5 * kSkirting},
              {0.5 * (b - a), kBoard, 0.5 * kSkirting}, "skirting", kVisual);
  };
  double at = 0;
  for (const Opening& o : openings) {
    piece(at, o.from, 0, kWallHeight);
    piece(o.from, o.to, 0, o.bottom);
    piece(o.from, o.to, o.top, kWallHeight);
    const double z = 0.5 * (o.bottom + o.top), tall = 0.5 * (o.top - o.bottom);
    for (const double edge : {o.from, o.to})
      out.box({edge, 0, z}, {0.006, half + 0.002, tall}, "skirting", kVisual);
    out.box({0.5 * (o.from + o.to), 0, o.top}, {0.5 * (o.to - o.from), half + 0.002, 0.006},
            "skirting", kVisual);
    at = o.to;
  }
  piece(at, length, 0, kWallHeight);
}

void write_window(RoomWriter& out, Vec3 at, double yaw, double width, double bottom, double top) {
  RoomWriter::Local local(out, "", at, yaw);
  const double half = 0.5 * width, middle = 0.5 * (bottom + top), tall = 0.5 * (top - bottom);
  const double deep = 0.5 * kWallThickness + 0.012;
  out.box({0, 0, middle}, {half, 0.004, tall}, "window_pane");
  for (const double side : {-1.0, 1.0}) {
    out.box({side * (half - 0.025), 0, middle}, {0.025, deep, tall}, "skirting", kVisual);
    out.box({0, 0, side > 0 ? top - 0.025 : bottom + 0.025}, {half, deep, 0.025}, "skirting",
            kVisual);
  }
  out.box({0, 0, middle}, {0.02, 0.02, tall}, "skirting", kVisual);
  out.box({0, 0, bottom + 1.24 * tall}, {half, 0.02, 0.018}, "skirting", kVisual);
  out.box({0, 0, bottom - 0.012}, {half + 0.05, deep + 0.06, 0.014}, "skirting", kVisual);
}

}  // namespace mjsense::tasks::scenes
