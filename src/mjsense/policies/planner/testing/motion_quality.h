// SPDX-License-Identifier: Apache-2.0
#pragma once
// How well a robot moved: looked at after every control step of an episode.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "mjsense/observe/frame.h"
#include "mjsense/policies/planner/collision.h"
#include "mjsense/scene/resolve.h"

namespace mjsense {

class MotionQuality {
 public:
  // Of the joints of all arms.
  double speed = 0;           // rad/s, greatest
  double acceleration = 0;    // rad/s^2, greatest between two control steps
  double accelerated_at = 0;  // s
  double depth = 0;           // m, deepest of a contact of the robot with anything
  std::string deepest;        // between which
  int self_collisions = 0;    // control steps in which links of the robot met

  MotionQuality(const mjModel* model, const Robot& robot) {
    std::vector<int> joints;
    for (const MoveGroup& group : robot.groups()) {
      if (group.kind != GroupKind::kArm) continue;
      joints.insert(joints.end(), group.joints.begin(), group.joints.end());
      dofs_.insert(dofs_.end(), group.dofs.begin(), group.dofs.end());
    }
    model_ = std::make_unique<CollisionModel>(model, robot, joints);
    root_ = model->body_rootid[robot.base_body()];
  }

  void look(const World& world) {
    const mjModel* m = world.model;
    const double time = world.time();
    for (std::size_t i = 0; i < dofs_.size(); ++i) {
      const double v = world.data->qvel[dofs_[i]];
      speed = std::max(speed, std::abs(v));
      if (time <= last_time_ || last_.size() != dofs_.size()) continue;
      const double a = std::abs(v - last_[i]) / (time - last_time_);
      if (a <= acceleration) continue;
      acceleration = a;
      accelerated_at = time;
    }
    last_.resize(dofs_.size());
    for (std::size_t i = 0; i < dofs_.size(); ++i) last_[i] = world.data->qvel[dofs_[i]];
    last_time_ = time;
    for (int c = 0; c < world.data->ncon; ++c) {
      const mjContact& contact = world.data->contact[c];
      if (contact.exclude || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
      const int a = m->geom_bodyid[contact.geom[0]], b = m->geom_bodyid[contact.geom[1]];
      if ((m->body_rootid[a] == root_) == (m->body_rootid[b] == root_)) continue;
      if (-contact.dist <= depth) continue;
      depth = -contact.dist;
      deepest = name_of(m, mjOBJ_BODY, a) + " in " + name_of(m, mjOBJ_BODY, b);
    }
    CollisionQuery query(*model_, world);
    for (int body = 1; body < m->nbody; ++body) {
      if (m->body_rootid[body] != root_ && m->body_parentid[body] == 0) query.ignore(body);
    }
    query.ignore(0);
    self_collisions += !query.free_here();
  }

 private:
  std::unique_ptr<CollisionModel> model_;
  std::vector<int> dofs_;
  std::vector<double> last_;
  double last_time_ = 1e9;
  int root_;
};

}  // namespace mjsense
