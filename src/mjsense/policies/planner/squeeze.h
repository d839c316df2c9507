// SPDX-License-Identifier: Apache-2.0
#pragma once
// What is between two pads before they close.

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "mjsense/core/pose.h"

namespace mjsense {

constexpr double kSideGap = 0.006;       // m, free on each side of the object before closing
constexpr double kLeastSideGap = 0.004;  // m, the same where the gripper opens hardly wider
constexpr double kFaceDepth = 0.002;     // m, what counts as one face
constexpr double kFaceWidth = 0.010;     // m, of the face that both pads touch
constexpr double kLeastWidth = 0.004;    // m, of an object

// Extent of the surface between the pads, and of the faces that they would touch.
struct Squeeze {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double face = 0;  // m, overlap of the two faces across the closing direction
};

inline Squeeze squeeze(std::span<const Vec3> points, Vec3 center, Vec3 close, Vec3 across,
                       Vec3 approach, double half_width, double half_length) {
  const auto inside = [&](Vec3 r) {
    return std::abs(dot(r, across)) <= half_width && std::abs(dot(r, approach)) <= half_length;
  };
  Squeeze s;
  for (Vec3 p : points) {
    const Vec3 r = p - center;
    if (!inside(r)) continue;
    const double c = dot(r, close);
    s.low = std::min(s.low, c);
    s.high = std::max(s.high, c);
  }
  if (!(s.low < s.high)) return s;
  double low0 = 1, low1 = -1, high0 = 1, high1 = -1;
  for (Vec3 p : points) {
    const Vec3 r = p - center;
    if (!inside(r)) continue;
    const double c = dot(r, close), u = dot(r, across);
    if (c < s.low + kFaceDepth) {
      low0 = std::min(low0, u);
      low1 = std::max(low1, u);
    }
    if (c > s.high - kFaceDepth) {
      high0 = std::min(high0, u);
      high1 = std::max(high1, u);
    }
  }
  s.face = std::min(low1, high1) - std::max(low0, high0);
  return s;
}

}  // namespace mjsense
