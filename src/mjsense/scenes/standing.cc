// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/standing.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "mjsense/observe/frame.h"

namespace mjsense {
namespace {

using std::numbers::pi;

constexpr int kGrid = 3;                     // points along each side of a target area
constexpr double kHeights[] = {0.06, 0.15};  // m above it, of the tool
constexpr double kTilts[] = {0, 45};         // degrees from above
constexpr double kStep = 0.05;               // m between two places
constexpr int kBack = 4, kAhead = 8;         // steps
constexpr double kEnough = 0.75;             // of the points
constexpr double kHang = 0.35;               // m, tool of a floating hand above the targets
constexpr double kHangBack = 0.15;           // m, nearer to where the scene has the robot
constexpr int kIterations = 250;
constexpr double kDeep = 0.001;  // m

// m, world: where tools have to get, and the middle of that on the surface.
std::vector<Vec3> targets(const mjModel* m, const EpisodeScene& scene) {
  std::vector<Vec3> points;
  for (const Region& region : scene.regions()) {
    const Area& a = region.target_area;
    for (int i = 0; i < kGrid; ++i) {
      for (int k = 0; k < kGrid; ++k) {
        points.push_back({a.x0 + (a.x1 - a.x0) * i / (kGrid - 1),
                          a.y0 + (a.y1 - a.y0) * k / (kGrid - 1), region.height});
      }
    }
  }
  if (!points.empty()) return points;
  for (const SceneObject& object : scene.objects())
    points.push_back(vec3(m->qpos0 + m->jnt_qposadr[m->body_jntadr[object.body]]));
  return points;
}

bool reaches(const Robot& robot, const RobotValues& start, const Pose& base, Vec3 point) {
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    if (robot.groups()[g].kind != GroupKind::kArm || robot.groups()[g].leaf_site < 0) continue;
    for (double tilt : kTilts) {
      for (int quarter = 0; quarter < 2; ++quarter) {
        // Down, leaning outwards, the fingers along or across.
        const Quat q =
            axis_angle({0, 1, 0}, pi - tilt * pi / 180) * axis_angle({0, 0, 1}, 0.5 * pi * quarter);
        RobotValues values = start;
        const Pose tool{point, base.q * q};
        if (robot.ik(static_cast<int>(g), inverse(base) * tool, values, kIterations)) return true;
      }
    }
  }
  return false;
}

}  // namespace

Standing::Standing(const mjModel* model, const Robot& robot, const EpisodeScene& scene) {
  const std::vector<Vec3> surface = targets(model, scene);
  if (surface.empty()) return;
  const SceneRobotCfg& cfg = scene.cfg().robot;
  const Pose base{{cfg.pos[0], cfg.pos[1], cfg.pos[2]}, axis_angle({0, 0, 1}, cfg.yaw * pi / 180)};
  bool has_arm = false, floats = false;
  RobotValues start;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    const auto& init = robot.cfg().groups[g].init;
    has_arm = has_arm || (group.kind == GroupKind::kArm && group.leaf_site >= 0);
    floats = floats || (group.kind == GroupKind::kBase && group.command_size == 7);
    start[g].size = static_cast<int>(group.qpos.size());
    for (std::size_t i = 0; i < group.qpos.size(); ++i)
      start[g].values[i] = i < init.size() ? init[i] : model->qpos0[group.qpos[i]];
  }
  if (!has_arm) {
    if (!floats || robot.gripper() < 0) return;
    Vec3 middle;
    double top = surface[0].z;
    for (Vec3 p : surface) {
      middle = middle + (1.0 / static_cast<double>(surface.size())) * p;
      top = std::max(top, p.z);
    }
    const double reach = robot.fk(robot.gripper(), start).p.z;
    const Vec3 back = rotate(base.q, {-kHangBack, 0, 0});
    const Pose hang{{middle.x + back.x, middle.y + back.y, top + kHang + reach},
                    base.q * Quat{0, 1, 0, 0}};
    offset_ = inverse(base) * hang;
    return;
  }

  std::vector<Vec3> points;
  for (Vec3 p : surface) {
    for (double height : kHeights) points.push_back(p + Vec3{0, 0, height});
  }
  const auto share = [&](const Pose& at) {
    int reached = 0;
    for (Vec3 p : points) reached += reaches(robot, start, at, p);
    return static_cast<double>(reached) / static_cast<double>(points.size());
  };
  double best = share(base);
  if (best >= kEnough) return;
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model), mj_deleteData);
  const int root = model->body_rootid[robot.base_body()];
  const auto is_free = [&](const Pose& at) {
    mj_resetData(model, data.get());
    Rng none(0, 0, 0, 0);
    robot.write_start(state_row(data.get()), at, none);
    for (const SceneObject& object : scene.objects())  // they come later, and never so near
      data->qpos[model->jnt_qposadr[model->body_jntadr[object.body]]] += 100;
    mj_kinematics(model, data.get());
    mj_comPos(model, data.get());
    mj_collision(model, data.get());
    for (int c = 0; c < data->ncon; ++c) {
      const mjContact& contact = data->contact[c];
      if (contact.geom[0] < 0 || contact.geom[1] < 0 || contact.dist > -kDeep) continue;
      const int a = model->body_rootid[model->geom_bodyid[contact.geom[0]]];
      const int b = model->body_rootid[model->geom_bodyid[contact.geom[1]]];
      if ((a == root) != (b == root)) return false;
    }
    return true;
  };
  for (int k = -kBack; k <= kAhead; ++k) {
    const Pose offset{{kStep * k, 0, 0}, {}};
    if (k == 0 || !is_free(base * offset)) continue;
    const double reached = share(base * offset);
    // Of equals the one that is nearer.
    if (reached < best || (reached == best && std::abs(offset.p.x) >= std::abs(offset_.p.x)))
      continue;
    best = reached;
    offset_ = offset;
  }
}

}  // namespace mjsense
