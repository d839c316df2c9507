// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/grasp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/observe/frame.h"
#include "mjsense_tasks/policies/planner/finger_contact.h"
#include "mjsense_tasks/robots/hands.h"

namespace mjsense::tasks::policies {
namespace {

using std::numbers::pi;

constexpr int kYaws = 24;              // closing directions over half a turn
constexpr double kSupportGap = 0.004;  // m, between finger tips and support
constexpr double kTopGap = 0.012;      // m, of the tool's origin below the top of a tall object
// Offsets (m) of the grasp along the object, perpendicular to the closing direction.
constexpr std::array<double, 5> kSlides{0.0, 0.012, -0.012, 0.024, -0.024};

constexpr double kSameEnd = 0.0005;  // m

}  // namespace

GripperShape::GripperShape(const mjModel* model, const robots::Robot& robot, int gripper) {
  const robots::MoveGroup& group = robot.groups()[gripper];
  const robots::MoveGroupCfg& cfg = robot.cfg().groups[gripper];
  const DataPtr data = make_data(model);
  for (std::size_t i = 0; i < cfg.init.size(); ++i) data->qpos[group.qpos[i]] = cfg.init[i];
  mj_kinematics(model, data.get());
  Pose world_tool = site_pose(data.get(), group.leaf_site);
  if (group.pad_sites[0] >= 0 && group.pad_sites[1] >= 0) {
    const Vec3 closing = robots::between_pads(data.get(), group);
    if (std::abs(closing.x) > std::abs(closing.y)) {
      turn = axis_angle({0, 0, 1}, 0.5 * pi);
      world_tool.q = world_tool.q * turn;
    }
  }
  max_opening = group.max_opening;
  Aabb bounds;
  for (int g = 0; g < model->ngeom; ++g) {
    if (!is_solid(model, g) ||
        !observe::is_descendant_or_self(model, model->geom_bodyid[g], group.root_body))
      continue;
    const double* aabb = model->geom_aabb + 6 * g;
    const Pose pose = inverse(world_tool) * geom_pose(data.get(), g) * Pose{vec3(aabb), {}};
    const Box box{pose, vec3(aabb + 3)};
    boxes.push_back(box);
    for (Vec3 corner : box_corners({}, box.half)) bounds.add(pose * corner);
  }
  center = bounds.center();
  radius = 0.5 * norm(bounds.size());
  // The fingers swing on arcs: half closed they reach slightly further than open.
  constexpr double kSwing = 0.005;
  tip = bounds.high.z + kSwing;
  pad_half_width = cfg.pad_half_width;
  pad_half_length = cfg.pad_half_length;
  // The pads end at the finger tips.
  if (bounds.high.z < pad_half_length - kSameEnd) pad_middle = bounds.high.z - pad_half_length;
}

bool GripperShape::hits(const Pose& tool, const Pose& object, const episode::ObjectShape& shape,
                        double margin) const {
  const Pose tool_object = inverse(tool) * object;
  if (norm(tool_object.p - center) > radius + shape.reach + margin) return false;
  for (const Box& box : boxes) {
    const Pose box_object = inverse(box.pose) * tool_object;
    const double reach = shape.reach + margin;
    if (std::abs(box_object.p.x) > box.half.x + reach ||
        std::abs(box_object.p.y) > box.half.y + reach ||
        std::abs(box_object.p.z) > box.half.z + reach) {
      continue;
    }
    for (Vec3 point : shape.points) {
      const Vec3 p = box_object * point;
      if (std::abs(p.x) < box.half.x + margin && std::abs(p.y) < box.half.y + margin &&
          std::abs(p.z) < box.half.z + margin) {
        return true;
      }
    }
  }
  return false;
}

std::vector<Grasp> propose_grasps(const GripperShape& gripper, const episode::ObjectShape& shape,
                                  const Pose& object, double support_height, const Pose& tool) {
  std::vector<Vec3> points;
  points.reserve(shape.points.size());
  double top = -std::numeric_limits<double>::infinity();
  for (Vec3 p : shape.points) {
    points.push_back(object * p);
    top = std::max(top, points.back().z);
  }
  // Closing directions start at a horizontal axis of the body: faces are often square to it.
  Vec3 flat = rotate(object.q, {1, 0, 0});
  if (std::abs(flat.z) > 0.7) flat = rotate(object.q, {0, 1, 0});
  const double yaw0 = std::atan2(flat.y, flat.x);
  const double lowest = support_height + gripper.tip + kSupportGap;
  const double highest = std::max(lowest, top - kTopGap);
  const double half_length = 0.9 * gripper.pad_half_length,
               half_width = 0.9 * gripper.pad_half_width;

  std::vector<Grasp> grasps;
  std::vector<Vec3> reached;
  const int levels = highest - lowest < 0.01 ? 1 : 4;
  for (int level = 0; level < levels; ++level) {
    const double z = levels == 1 ? lowest : lowest + (highest - lowest) * level / (levels - 1);
    const double pads = z - gripper.pad_middle;
    points_between(points, {0, 0, 1}, pads - half_length, pads + half_length, reached);
    for (int k = 0; k < kYaws; ++k) {
      const double yaw = yaw0 + pi * k / kYaws;
      const Vec3 close{std::cos(yaw), std::sin(yaw), 0}, across{-close.y, close.x, 0};
      for (double slide : kSlides) {
        const Vec3 center = Vec3{object.p.x, object.p.y, z} + slide * across;
        const FingerContact s =
            measure_finger_contact(reached, center - Vec3{0, 0, gripper.pad_middle}, close, across,
                                   {0, 0, 1}, half_width, half_length);
        const double width = s.high - s.low;
        if (!(width > kMinWidth && width < gripper.max_opening - 2 * kSideGap) ||
            s.face < kFaceWidth)
          continue;
        const Vec3 position = center + (0.5 * (s.low + s.high)) * close;
        // The tool's y axis may point either way along the closing direction.
        for (int flip = 0; flip < 2; ++flip) {
          const Vec3 y = flip ? -close : close, approach{0, 0, -1};
          Grasp grasp;
          grasp.pose = {position, quat_from_columns(cross(y, approach), y, approach)};
          grasp.width = width;
          if (gripper.hits(grasp.pose, object, shape, 0.0)) continue;
          grasp.cost = norm(position - tool.p) +
                       0.01 * angle_between(tool.q, grasp.pose.q) * 180.0 / pi + 2.0 * approach.z +
                       8.0 * norm(position - object.p);
          grasps.push_back(grasp);
        }
      }
    }
  }
  std::ranges::stable_sort(grasps, {}, &Grasp::cost);
  return grasps;
}

}  // namespace mjsense::tasks::policies
