// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/robot_floor.h"

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/start_positions.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr double kHeadroom = 0.05;  // m

}  // namespace

int driving_base(const robots::Robot& robot) {
  const auto is_one = [](const robots::MoveGroup& group) {
    return group.kind == robots::GroupKind::kBase && group.command_size == 3 &&
           group.target_size == 3;
  };
  const auto at = std::ranges::find_if(robot.groups(), is_one);
  return at == robot.groups().end() ? -1 : static_cast<int>(at - robot.groups().begin());
}

std::optional<double> ground_height(const mjModel* m) {
  for (int g = 0; g < m->ngeom; ++g) {
    const int body = m->geom_bodyid[g];
    if (m->geom_type[g] != mjGEOM_PLANE || !is_solid(m, g) || m->body_treeid[body] >= 0) continue;
    const Pose plane = in_ancestor(m, geom_frame(m, g), body);
    if (rotate(plane.q, {0, 0, 1}).z > 1 - 1e-9) return plane.p.z;
  }
  return {};
}

RestingRobot::RestingRobot(const mjModel* model, const robots::Robot& robot)
    : model_(model), robot_(robot), data_(make_data(model)) {
  robots::write_start_positions(robot, data_->qpos);
  mj_kinematics(model, data_.get());
}

bool RestingRobot::of_robot(int geom) const {
  const int body = model_->geom_bodyid[geom];
  if (!robot_.prefix().empty() &&
      scene::name_of(model_, mjOBJ_BODY, body).starts_with(robot_.prefix()))
    return true;
  return robot_.base_body() > 0 && observe::is_descendant_or_self(model_, body, robot_.base_body());
}

Footprint RestingRobot::footprint() const {
  return {model_, data_.get(), [this](int g) { return of_robot(g); },
          robot_.base_pose({.model = model_, .data = data_.get()}), 10.0};
}

Footprint RestingRobot::trunk() const {
  return {
      model_, data_.get(),
      [this](int g) {
        const auto holds = [&](const robots::MoveGroup& group) {
          const bool limb =
              group.kind == robots::GroupKind::kArm || group.kind == robots::GroupKind::kGripper;
          return limb && group.root_body > 0 &&
                 observe::is_descendant_or_self(model_, model_->geom_bodyid[g], group.root_body);
        };
        return of_robot(g) && std::ranges::none_of(robot_.groups(), holds);
      },
      robot_.base_pose({.model = model_, .data = data_.get()}), 10.0};
}

OccupancyGrid RestingRobot::occupancy(double height,
                                      const std::function<std::vector<Pose>(int)>& elsewhere,
                                      const std::function<bool(int)>& without) const {
  OccupancyCfg cfg;
  cfg.high = height + kHeadroom;
  cfg.elsewhere = elsewhere;
  return {model_, data_.get(),
          [&](int g) {
            const int root = model_->body_rootid[model_->geom_bodyid[g]];
            const bool loose = root > 0 && model_->body_jntnum[root] == 1 &&
                               model_->jnt_type[model_->body_jntadr[root]] == mjJNT_FREE;
            return !loose && !of_robot(g) && !(without && without(g));
          },
          cfg};
}

}  // namespace mjsense::tasks::scenes
