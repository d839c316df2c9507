// SPDX-License-Identifier: Apache-2.0
#pragma once
// The part of an object's surface between two pads before they close.

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::policies {

constexpr double kSideGap = 0.006;      // m, gap on each side of the object before closing
constexpr double kMinSideGap = 0.0025;  // m, the same for grippers with a small maximum opening
constexpr double kFaceDepth = 0.002;    // m, points within this depth form one face
constexpr double kFaceWidth = 0.010;    // m, minimum width of the face that both pads touch
constexpr double kMinWidth = 0.004;     // m, minimum width of an object

// Extent (m) of the surface between the pads along the closing direction, and the faces that the
// pads would touch.
struct FingerContact {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double face = 0;  // m, overlap of the two faces across the closing direction
  // increase of the width along the approach (m per m); the object slips out if it is large
  double slope = 0;
};

// The points with a coordinate from `from` to `to` along the approach, and those within rounding of
// these limits: a superset of the points that measure_finger_contact() finds between the pads there.
inline void points_between(std::span<const Vec3> points, Vec3 approach, double from, double to,
                           std::vector<Vec3>& out) {
  constexpr double kRounding = 1e-9;  // m
  out.clear();
  for (Vec3 p : points) {
    const double v = dot(p, approach);
    if (v >= from - kRounding && v <= to + kRounding) out.push_back(p);
  }
}

inline FingerContact measure_finger_contact(std::span<const Vec3> points, Vec3 center, Vec3 close,
                                            Vec3 across, Vec3 approach, double half_width,
                                            double half_length) {
  const auto inside = [&](Vec3 r) {
    return std::abs(dot(r, across)) <= half_width && std::abs(dot(r, approach)) <= half_length;
  };
  FingerContact s;
  double near = half_length, far = -half_length;
  for (Vec3 p : points) {
    const Vec3 r = p - center;
    if (!inside(r)) continue;
    const double c = dot(r, close), v = dot(r, approach);
    s.low = std::min(s.low, c);
    s.high = std::max(s.high, c);
    near = std::min(near, v);
    far = std::max(far, v);
  }
  if (!(s.low < s.high)) return s;
  double low0 = 1, low1 = -1, high0 = 1, high1 = -1;
  double near_low = s.high, near_high = s.low, far_low = s.high, far_high = s.low;
  for (Vec3 p : points) {
    const Vec3 r = p - center;
    if (!inside(r)) continue;
    const double c = dot(r, close), u = dot(r, across), v = dot(r, approach);
    const bool in_near = v < 0.5 * (near + far);
    double &minimum = in_near ? near_low : far_low, &maximum = in_near ? near_high : far_high;
    minimum = std::min(minimum, c);
    maximum = std::max(maximum, c);
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
  if (!(near_low < near_high && far_low < far_high)) {
    s.slope = std::numeric_limits<double>::infinity();
    return s;
  }
  s.slope = ((far_high - far_low) - (near_high - near_low)) / std::max(0.5 * (far - near), 0.001);
  return s;
}

}  // namespace mjsense::tasks::policies
