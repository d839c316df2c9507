// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "mjsense/core/aabb.h"
#include "mjsense_tasks/policies/planner/finger_contact.h"
#include "mjsense_tasks/policies/planner/grasp.h"

namespace mjsense::tasks::policies {
namespace {

using std::numbers::pi;

// closing directions over half a sphere, in addition to those about the axes
constexpr int kDirections = 40;
constexpr int kAroundAxis = 12;  // closing directions about each axis of the body
constexpr int kApproaches = 16;  // approaches for each closing direction
// m, perpendicular to closing direction and approach
constexpr std::array<double, 3> kAnyDirectionSlides{0.0, 0.015, -0.015};
// m, depth of the pads' ends behind the first surface along the approach. The small depths are for
// flat objects, where deeper finger tips would hit the support.
constexpr std::array<double, 4> kDepths{0.0091, 0.0191, 0.0291, 0.0471};
constexpr double kSlope = 4.0, kMaxSlope = 4.0;  // cost of the slope, and its maximum
constexpr std::size_t kPoints = 450;             // maximum number of surface points that are used

std::vector<Vec3> closing_directions() {
  std::vector<Vec3> all;
  for (int k = 0; k < kAroundAxis; ++k) {
    const double a = pi * k / kAroundAxis, c = std::cos(a), s = std::sin(a);
    all.push_back({c, s, 0});
    if (k > 0) all.push_back({c, 0, s});
    if (k > 0 && 2 * k != kAroundAxis) all.push_back({0, c, s});
  }
  const double golden = pi * (3 - std::sqrt(5.0));
  for (int k = 0; k < kDirections; ++k) {  // a spiral over the upper half
    const double z = (k + 0.5) / kDirections, r = std::sqrt(1 - z * z);
    all.push_back({r * std::cos(golden * k), r * std::sin(golden * k), z});
  }
  return all;
}

Vec3 some_normal(Vec3 v) {
  const Vec3 axis = std::abs(v.z) < 0.8 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  return normalized(cross(v, axis));
}

}  // namespace

double GripperShape::lowest(const Pose& tool) const {
  double z = std::numeric_limits<double>::infinity();
  for (const Box& box : boxes) {
    const Pose at = tool * box.pose;
    z = std::min(z, at.p.z - std::abs(rotate(at.q, {box.half.x, 0, 0}).z) -
                        std::abs(rotate(at.q, {0, box.half.y, 0}).z) -
                        std::abs(rotate(at.q, {0, 0, box.half.z}).z));
  }
  return z;
}

std::string text_of(const GraspChecks& checks, const GripperShape& gripper) {
  std::vector<std::pair<int, std::string>> parts{
      {checks.nothing_between, "without 4 mm of the object between the pads"},
      {checks.too_wide, fmt::format("too wide for the gripper, whose max_opening is {:g} mm",
                                    1000 * gripper.max_opening)},
      {checks.no_faces, "without opposite faces of 10 mm for the pads"},
      {checks.in_object, "with the open gripper in the object"}};
  std::erase_if(parts, [](const auto& part) { return part.first == 0; });
  std::ranges::stable_sort(parts, std::ranges::greater(),
                           [](const auto& part) { return part.first; });
  std::string text = fmt::format("0 grasps, of {} candidates: ", checks.candidates);
  for (const auto& part : parts)
    text += fmt::format("{}{} {}", &part == parts.data() ? "" : "; ", part.first, part.second);
  return text;
}

std::vector<Grasp> grasps_all_around(const GripperShape& gripper, const episode::ObjectShape& shape,
                                     GraspChecks* checks) {
  GraspChecks unused;
  GraspChecks& count = checks ? *checks : unused;
  std::vector<Vec3> points;
  const std::size_t stride = shape.points.size() / kPoints + 1;
  for (std::size_t i = 0; i < shape.points.size(); i += stride) points.push_back(shape.points[i]);
  // The middle of the bounding box, since a body's origin may be anywhere.
  const Vec3 middle = aabb_of(points).center();
  const double half_length = 0.9 * gripper.pad_half_length,
               half_width = 0.9 * gripper.pad_half_width;
  std::vector<Grasp> grasps;
  std::vector<Vec3> reached;
  for (Vec3 close : closing_directions()) {
    const Vec3 first = some_normal(close);
    for (int k = 0; k < kApproaches; ++k) {
      const Vec3 approach = rotate(axis_angle(close, 2 * pi * k / kApproaches), first);
      const Vec3 across = cross(close, approach);
      double near = std::numeric_limits<double>::infinity(), far = -near;
      for (Vec3 p : points) {
        near = std::min(near, dot(p - middle, approach));
        far = std::max(far, dot(p - middle, approach));
      }
      // The middle of the object limits the depth.
      const double mid = 0.5 * (near + far);
      for (double end : kDepths) {
        const double depth = end - half_length - gripper.pad_middle;
        if (near + depth > mid + 0.002) break;
        const double pads = dot(middle, approach) + near + depth + gripper.pad_middle;
        points_between(points, approach, pads - half_length, pads + half_length, reached);
        for (double slide : kAnyDirectionSlides) {
          const Vec3 center = middle + (near + depth) * approach + slide * across;
          const FingerContact s =
              measure_finger_contact(reached, center + gripper.pad_middle * approach, close, across,
                                     approach, half_width, half_length);
          const double width = s.high - s.low;
          ++count.candidates;
          int* const rejected = !(width > kMinWidth) ? &count.nothing_between
                                : !(width < gripper.max_opening - 2 * kMinSideGap) ? &count.too_wide
                                : s.face < kFaceWidth                              ? &count.no_faces
                                                                                   : nullptr;
          if (rejected) {
            ++*rejected;
            continue;
          }
          Grasp grasp;
          grasp.pose = {center + (0.5 * (s.low + s.high)) * close,
                        quat_from_columns(cross(close, approach), close, approach)};
          grasp.width = width;
          grasp.cost = 8.0 * norm(grasp.pose.p) + std::min(kMaxSlope, kSlope * std::abs(s.slope));
          if (gripper.hits(grasp.pose, {}, shape, 0.0)) {
            ++count.in_object;
          } else {
            grasps.push_back(grasp);
          }
        }
      }
    }
  }
  return grasps;
}

std::vector<Grasp> rank_grasps(std::span<const Grasp> of_object, const Pose& object,
                               const Pose& tool, Vec3 wanted) {
  std::vector<Grasp> grasps;
  grasps.reserve(2 * of_object.size());
  for (const Grasp& grasp : of_object) {
    // The tool's y axis may point either way along the closing direction.
    for (const Quat flip : {Quat{}, Quat{0, 0, 0, 1}}) {
      Grasp g = grasp;
      g.pose = object * grasp.pose * Pose{{}, flip};
      g.cost += norm(g.pose.p - tool.p) + 0.01 * angle_between(tool.q, g.pose.q) * 180.0 / pi -
                2.0 * dot(rotate(g.pose.q, {0, 0, 1}), wanted);
      grasps.push_back(g);
    }
  }
  std::ranges::stable_sort(grasps, {}, &Grasp::cost);
  return grasps;
}

}  // namespace mjsense::tasks::policies
