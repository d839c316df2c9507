// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/base_motion.h"

#include <algorithm>
#include <cmath>

namespace mjsense::tasks {
namespace {

constexpr double kShares[] = {0.75, 1.0, 0.5, 0.25, 0.0};
constexpr double kPlaces[] = {0, -0.15, 0.15, -0.3, 0.3};  // m
constexpr double kTurns[] = {0, -0.35, 0.35};              // rad
constexpr std::size_t kMax = 90;                           // number of candidates kept, by cost
constexpr double kUpright = 0.7;                           // minimum |z| of a vertical axis
// Costs in metres: of a share that differs from the first one, and of a turn.
constexpr double kShareCost = 0.3, kTurnCost = 0.4;  // m, m/rad

double cost(const Drive& d) {
  return std::hypot(d.x, d.y) + kTurnCost * std::abs(d.turn) +
         kShareCost * std::abs(d.share - kShares[0]);
}

std::vector<Drive> all() {
  std::vector<Drive> out;
  for (double share : kShares) {
    for (double x : kPlaces) {
      for (double y : kPlaces) {
        for (double turn : kTurns) out.push_back({share, x, y, turn});
      }
    }
  }
  std::ranges::stable_sort(out, {}, cost);
  out.resize(kMax);
  return out;
}

}  // namespace

scenes::BasePose driven(const scenes::BasePose& from, const Drive& drive,
                        const HandleMotion& motion, Vec3 tool, double part) {
  scenes::BasePose base = from;
  if (!motion.one->slide && std::abs(motion.axis.z) > kUpright) {
    // Rotate about the hinge in the horizontal plane.
    const double angle = drive.share * part * (motion.to - motion.from) * motion.axis.z;
    const double c = std::cos(angle), s = std::sin(angle);
    const double x = from.x - motion.anchor.x, y = from.y - motion.anchor.y;
    base.x = motion.anchor.x + c * x - s * y;
    base.y = motion.anchor.y + s * x + c * y;
    base.yaw += angle;
  } else {
    const Vec3 moved = motion.at(part) * tool - tool;
    base.x += drive.share * moved.x;
    base.y += drive.share * moved.y;
  }
  base.x += part * drive.x;
  base.y += part * drive.y;
  base.yaw += part * drive.turn;
  return base;
}

const std::vector<Drive>& drives() {
  static const std::vector<Drive> known = all();
  return known;
}

}  // namespace mjsense::tasks
