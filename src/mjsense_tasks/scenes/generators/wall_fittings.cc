// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/wall_fittings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kRail = 0.95;    // m, height of the panels
constexpr double kLow = 0.10;     // m, above the skirting board
constexpr double kPanel = 0.42;   // m, distance between upright boards
constexpr double kRackZ = 1.62;   // m
constexpr double kSwitchZ = 1.1;  // m

void coat(RoomWriter& out, double x, std::string_view cloth, Rng& rng) {
  const double half = rng.uniform(0.30, 0.42), top = kRackZ - 0.06;
  out.box({x, -0.065, top - half - 0.02}, {0.15, 0.045, half}, cloth, kVisual);
  out.capsule({x - 0.11, -0.065, top - 0.02}, {x + 0.11, -0.065, top - 0.02}, 0.045, cloth,
              kVisual);
  for (const double side : {-1.0, 1.0})
    out.capsule({x + side * 0.14, -0.07, top - 0.03}, {x + side * 0.20, -0.07, top - 0.56}, 0.042,
                cloth, kVisual);
}

}  // namespace

void write_panelling(RoomWriter& out, double from, double to) {
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  if (half <= 0) return;
  const auto visual = [&](Vec3 at, Vec3 size, std::string_view material) {
    out.box(at, size, material, kVisual);
  };
  visual({middle, -0.003, 0.5 * kRail}, {half, 0.003, 0.5 * kRail}, "panel");
  visual({middle, -0.012, kRail}, {half, 0.012, 0.018}, "skirting");
  visual({middle, -0.007, kRail - 0.07}, {half, 0.007, 0.035}, "panel");
  const int boards = std::max(1, static_cast<int>(std::lround(2 * half / kPanel)));
  for (int i = 0; i <= boards; ++i) {
    const double x = std::clamp(from + 2 * half * i / boards, from + 0.03, to - 0.03);
    visual({x, -0.007, 0.5 * (kLow + kRail)}, {0.03, 0.007, 0.5 * (kRail - kLow)}, "panel");
  }
}

void write_coat_rack(RoomWriter& out, double x, Rng& rng) {
  constexpr int kPegs = 4;
  out.box({x, -0.011, kRackZ}, {0.38, 0.011, 0.045}, "wood", kVisual);
  const auto peg = [&](int i) { return x + 0.20 * (i - 0.5 * (kPegs - 1)); };
  for (int i = 0; i < kPegs; ++i)
    out.capsule({peg(i), -0.02, kRackZ - 0.01}, {peg(i), -0.075, kRackZ + 0.015}, 0.008, "steel",
                kVisual);
  coat(out, peg(0), "cloth_1", rng);
  if (rng.below(2) == 0) coat(out, peg(2), "cloth_3", rng);
  // A bag on the last peg.
  const double at = peg(kPegs - 1), low = kRackZ - rng.uniform(0.42, 0.52);
  for (const double side : {-1.0, 1.0})
    out.capsule({at, -0.06, kRackZ}, {at + side * 0.09, -0.05, low + 0.13}, 0.006, "black",
                kVisual);
  out.box({at, -0.05, low}, {0.12, 0.045, 0.13}, "cloth_2", kVisual);
}

void write_light_switch(RoomWriter& out, double x) {
  out.box({x, -0.004, kSwitchZ}, {0.042, 0.004, 0.042}, "skirting", kVisual);
  out.box({x, -0.010, kSwitchZ}, {0.024, 0.004, 0.024}, "white_wood", kVisual);
}

void write_wall_clock(RoomWriter& out, double x, Rng& rng) {
  constexpr double kZ = 1.75, kRadius = 0.15;
  const Quat flat = axis_angle({1, 0, 0}, 0.5 * pi);
  out.ellipsoid({x, -0.010, kZ}, {kRadius, kRadius, 0.012}, "black", flat);
  out.ellipsoid({x, -0.014, kZ}, {kRadius - 0.015, kRadius - 0.015, 0.011}, "sheet", flat);
  const double hour = rng.uniform(0, 2 * pi);
  for (const auto& [angle, length] : {std::pair{hour, 0.07}, std::pair{12 * hour, 0.11}})
    out.capsule({x, -0.028, kZ},
                {x + length * std::sin(angle), -0.028, kZ + length * std::cos(angle)}, 0.004,
                "black", kVisual);
}

}  // namespace mjsense::tasks::scenes
