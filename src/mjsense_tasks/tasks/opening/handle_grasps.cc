// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/handle_grasps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks {
namespace {

constexpr std::array<double, 5> kTilts{0, 0.35, -0.35, 0.7, -0.7};  // rad, about the handle
constexpr std::array<double, 3> kTurns{0, 0.4, -0.4};               // rad, across the handle
constexpr std::array<double, 3> kPlaces{0, 0.45, -0.45};            // fractions of its half length
constexpr double kSideGap = 0.004;  // m, clearance between the pads and the handle

// Rotation about the approach axis to the closing direction, which is found from the positions of
// the open pads in the tool frame.
Quat closing_turn(const robots::MoveGroup& gripper, const mjModel* model) {
  if (gripper.pad_sites[0] < 0 || gripper.leaf_site < 0) return {};
  const DataPtr data = make_data(model);
  // Open: the end of the range with the larger opening.
  for (std::size_t i = 0; i < gripper.qpos.size(); ++i) {
    const int joint = gripper.joints[std::min(i, gripper.joints.size() - 1)];
    const double low = model->jnt_range[2 * joint], high = model->jnt_range[2 * joint + 1];
    if (model->jnt_type[joint] == mjJNT_SLIDE && model->jnt_limited[joint])
      data->qpos[gripper.qpos[i]] = std::abs(low) > std::abs(high) ? low : high;
  }
  mj_kinematics(model, data.get());
  const Vec3 apart = robots::between_pads(data.get(), gripper);
  if (std::hypot(apart.x, apart.y) < 1e-4) return {};
  const double angle = 0.5 * std::numbers::pi - std::atan2(apart.y, apart.x);
  // Only 0 or 90 degrees: pads that are slightly off-center must not rotate the frame.
  return axis_angle({0, 0, 1},
                    0.5 * std::numbers::pi * std::round(angle / (0.5 * std::numbers::pi)));
}

}  // namespace

std::vector<OrientedHand> oriented_hands(const robots::Robot& robot, const mjModel* model) {
  std::vector<OrientedHand> hands;
  for (const robots::Hand& hand : robots::hands_of(robot, model))
    hands.push_back({hand, closing_turn(robot.groups()[hand.gripper], model)});
  return hands;
}

std::vector<HandleGrasp> propose_handle_grasps(const Handle& handle, const Pose& body,
                                               double max_opening) {
  std::vector<HandleGrasp> grasps;
  const Vec3 along = rotate(body.q, handle.direction), outward = rotate(body.q, handle.outward);
  const Vec3 middle = body * handle.middle;
  const bool knob = handle.half_length < 0.03;
  for (int side = 0; side < (knob ? 2 : 1); ++side) {
    // The fingers close perpendicular to the bar. A knob may also be grasped along it.
    const Vec3 bar = side == 0 ? along : normalized(cross(along, outward));
    const double across = side == 0 ? handle.half_across : handle.half_length;
    if (2 * across + 2 * kSideGap > max_opening) continue;
    for (double turn : kTurns) {
      for (double tilt : kTilts) {
        for (double place : kPlaces) {
          if (knob && place != 0) continue;
          Vec3 approach = rotate(axis_angle(bar, tilt), -outward);
          const Vec3 close = normalized(cross(bar, approach));
          approach = rotate(axis_angle(close, turn), approach);
          for (int flip = -1; flip <= 1; flip += 2) {
            const Vec3 y = static_cast<double>(flip) * close;
            const Vec3 position = middle + (place * handle.half_length) * bar;
            const double cost =
                std::abs(tilt) + 1.2 * std::abs(turn) + 0.3 * std::abs(place) + 0.1 * side;
            grasps.push_back(
                {{position, quat_from_columns(cross(y, approach), y, approach)}, cost});
          }
        }
      }
    }
  }
  std::ranges::stable_sort(grasps, {}, &HandleGrasp::cost);
  return grasps;
}

}  // namespace mjsense::tasks
