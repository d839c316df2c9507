// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/collision.h"

#include <algorithm>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense_tasks/robots/start_positions.h"

namespace mjsense::tasks::policies {
namespace {

constexpr double kTurnStep = 0.04;    // rad between two configurations that are checked
constexpr double kSlideStep = 0.015;  // m

bool is_checked(const mjModel* m, int g) {
  return is_solid(m, g) && m->geom_type[g] != mjGEOM_HFIELD && m->geom_type[g] != mjGEOM_SDF;
}

bool may_touch(const mjModel* m, int a, int b) {
  return (m->geom_contype[a] & m->geom_conaffinity[b]) ||
         (m->geom_contype[b] & m->geom_conaffinity[a]);
}

bool is_neighbour(const mjModel* m, int a, int b) {
  const int wa = m->body_weldid[m->geom_bodyid[a]], wb = m->body_weldid[m->geom_bodyid[b]];
  return wa == wb || m->body_weldid[m->body_parentid[wa]] == wb ||
         m->body_weldid[m->body_parentid[wb]] == wa;
}

// mj_geomDistance without the segment. No object with a destructor may live in this frame: a MuJoCo
// error leaves it by longjmp.
double distance(const mjModel* m, mjData* d, int a, int b, double maximum) {
  return mj_geomDistance(m, d, a, b, maximum, nullptr);
}

}  // namespace

CollisionModel::CollisionModel(const mjModel* model, const robots::Robot& robot,
                               std::vector<int> joints)
    : robot_(&robot), joints_(std::move(joints)), scratch_(model) {
  const int root = model->body_rootid[robot.base_body()];
  std::vector<char> moves(model->nbody, 0);
  for (int b = 1; b < model->nbody; ++b) {
    moves[b] = moves[model->body_parentid[b]];
    for (int j = model->body_jntadr[b]; j < model->body_jntadr[b] + model->body_jntnum[b]; ++j)
      moves[b] = moves[b] || std::ranges::count(joints_, j) > 0;
  }
  std::vector<int> own;
  for (int g = 0; g < model->ngeom; ++g) {
    if (!is_checked(model, g)) continue;
    const int body = model->geom_bodyid[g];
    const bool of_robot = body > 0 && model->body_rootid[body] == root;
    if (of_robot) own.push_back(g);
    if (moves[body]) moving_.push_back(g);
    if (!of_robot && !moves[body]) scene_.push_back(g);
  }
  // Pairs of links in contact at the start configuration are exempt from collision checks.
  const worlds::ScratchData::Loan loan = scratch_.borrow();
  mjData* d = loan.get();
  robots::write_start_positions(robot, d->qpos);
  mj_kinematics(model, d);
  for (std::size_t i = 0; i < own.size(); ++i) {
    for (std::size_t k = i + 1; k < own.size(); ++k) {
      const int a = own[i], b = own[k];
      if (!moves[model->geom_bodyid[a]] && !moves[model->geom_bodyid[b]]) continue;
      if (is_neighbour(model, a, b) || distance(model, d, a, b, 0.002) < 0.002) continue;
      self_.emplace_back(a, b);
    }
  }
}

CollisionQuery::CollisionQuery(CollisionModel& model, const World& world)
    : cm_(model),
      m_(world.model),
      loan_(model.scratch_.borrow()),
      d_(loan_.get()),
      scene_(model.scene_) {
  worlds::copy_positions(m_, world.data, d_);
  between_.resize(cm_.joints_.size());
}

void CollisionQuery::ignore(int body) {
  std::erase_if(
      scene_, [&](int g) { return observe::is_descendant_or_self(m_, m_->geom_bodyid[g], body); });
}

void CollisionQuery::ignore_below(double height) {
  mj_kinematics(m_, d_);
  std::erase_if(scene_, [&](int g) {
    const double *row = d_->geom_xmat + 9 * g + 6, *aabb = m_->geom_aabb + 6 * g;
    double top = d_->geom_xpos[3 * g + 2];
    if (m_->geom_type[g] == mjGEOM_PLANE) return row[2] > 1 - 1e-9 && top < height;
    for (int i = 0; i < 3; ++i) top += row[i] * aabb[i] + std::abs(row[i]) * aabb[3 + i];
    return top < height;
  });
}

void CollisionQuery::allow(int gripper, int body) {
  allowed_.push_back({cm_.robot_->groups()[gripper].root_body, body});
}

void CollisionQuery::hold(int tool, int gripper, int body, const Pose& tool_object) {
  ignore(body);
  mj_kinematics(m_, d_);
  Held& held = held_.emplace_back();
  held.site = cm_.robot_->groups()[tool].leaf_site;
  held.contact = {cm_.robot_->groups()[gripper].root_body, body};
  held.tool_object = tool_object;
  const Pose object = body_pose(d_, body);
  for (int g = 0; g < m_->ngeom; ++g) {
    if (!is_checked(m_, g) || !observe::is_descendant_or_self(m_, m_->geom_bodyid[g], body))
      continue;
    held.geoms.push_back(g);
    held.object_geom.push_back(inverse(object) * geom_pose(d_, g));
  }
}

void CollisionQuery::open(int gripper) {
  const robots::MoveGroup& group = cm_.robot_->groups()[gripper];
  const auto& init = cm_.robot_->cfg().groups[gripper].init;
  for (int j = 0; j < m_->njnt; ++j) {
    const int type = m_->jnt_type[j];
    if ((type != mjJNT_HINGE && type != mjJNT_SLIDE) ||
        !observe::is_descendant_or_self(m_, m_->jnt_bodyid[j], group.root_body))
      continue;
    const int qpos = m_->jnt_qposadr[j];
    d_->qpos[qpos] = m_->qpos0[qpos];
  }
  for (std::size_t i = 0; i < init.size(); ++i) d_->qpos[group.qpos[i]] = init[i];
}

void CollisionQuery::place(int body, const Pose& pose) {
  const int joint = m_->body_jntadr[body];
  if (joint < 0 || m_->jnt_type[joint] != mjJNT_FREE) return;
  write_pose(pose, d_->qpos + free_qpos(m_, body));
}

void CollisionQuery::place_base(const Pose& base) { place(cm_.robot_->base_body(), base); }

void CollisionQuery::move_held() {
  for (const Held& held : held_) {
    const Pose tool = site_pose(d_, held.site);
    const Pose object = tool * held.tool_object;
    for (std::size_t i = 0; i < held.geoms.size(); ++i) {
      const Pose geom = object * held.object_geom[i];
      double q[4];
      write_vec(geom.p, d_->geom_xpos + 3 * held.geoms[i]);
      write_quat(geom.q, q);
      mju_quat2Mat(d_->geom_xmat + 9 * held.geoms[i], q);
    }
  }
}

// True if the bounding sphere of `moving` is within the margin of the bounding box of `other`.
bool CollisionQuery::near_enough(int moving, int other) const {
  const double reach = m_->geom_rbound[moving] + margin_;
  const double* c = d_->geom_xpos + 3 * moving;
  const double *x = d_->geom_xpos + 3 * other, *r = d_->geom_xmat + 9 * other;
  const double v[3] = {c[0] - x[0], c[1] - x[1], c[2] - x[2]};
  if (m_->geom_type[moving] == mjGEOM_PLANE) return true;
  if (m_->geom_type[other] == mjGEOM_PLANE) return v[0] * r[2] + v[1] * r[5] + v[2] * r[8] < reach;
  const double* aabb = m_->geom_aabb + 6 * other;
  double outside = 0;
  for (int i = 0; i < 3; ++i) {
    const double p = v[0] * r[i] + v[1] * r[3 + i] + v[2] * r[6 + i] - aabb[i];
    const double o = std::max(0.0, std::abs(p) - aabb[3 + i]);
    outside += o * o;
  }
  return outside < reach * reach;
}

bool CollisionQuery::hit(int a, int b) {
  if (!near_enough(a, b) || !near_enough(b, a)) return false;
  if (distance(m_, d_, a, b, std::max(margin_, 1e-9)) >= margin_) return false;
  touching_ = {a, b};
  return true;
}

bool CollisionQuery::free_here() {
  mj_kinematics(m_, d_);
  move_held();
  const auto is_allowed = [&](int g, int other) {
    return std::ranges::any_of(allowed_, [&](const robots::AllowedContact& contact) {
      return contact.permits(m_, m_->geom_bodyid[g], m_->geom_bodyid[other]);
    });
  };
  for (int g : cm_.moving_) {
    for (int other : scene_) {
      if (may_touch(m_, g, other) && hit(g, other) && !is_allowed(g, other)) return false;
    }
  }
  for (const auto& [a, b] : cm_.self_) {
    if (hit(a, b)) return false;
  }
  for (const Held& held : held_) {
    for (int g : held.geoms) {
      for (int other : scene_) {
        if (may_touch(m_, g, other) && hit(g, other)) return false;
      }
      for (int other : cm_.moving_) {
        if (!held.contact.permits(m_, m_->geom_bodyid[other], m_->geom_bodyid[g]) && hit(g, other))
          return false;
      }
    }
  }
  return true;
}

bool CollisionQuery::free(std::span<const double> q) {
  for (std::size_t i = 0; i < q.size(); ++i) d_->qpos[m_->jnt_qposadr[cm_.joints_[i]]] = q[i];
  return free_here();
}

bool CollisionQuery::free_between(std::span<const double> from, std::span<const double> to) {
  double steps = 1;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const double step = m_->jnt_type[cm_.joints_[i]] == mjJNT_SLIDE ? kSlideStep : kTurnStep;
    steps = std::max(steps, std::abs(to[i] - from[i]) / step);
  }
  // Coarse steps first, then finer ones: this finds collisions early.
  const int n = 1 << static_cast<int>(std::ceil(std::log2(steps)));
  for (int stride = n; stride > 1; stride /= 2) {
    for (int k = stride / 2; k < n; k += stride) {
      const double s = static_cast<double>(k) / n;
      for (std::size_t i = 0; i < from.size(); ++i) between_[i] = from[i] + s * (to[i] - from[i]);
      if (!free(between_)) return false;
    }
  }
  return true;
}

}  // namespace mjsense::tasks::policies
