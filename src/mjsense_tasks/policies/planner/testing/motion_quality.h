// SPDX-License-Identifier: Apache-2.0
#pragma once
// Measures how a robot moves and what is commanded, after every control step of an episode. For
// commands c at control steps dt apart, (c' - c) / dt is a speed, and its change divided by dt an
// acceleration: those of a robot that moves linearly from command to command.

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/observe/frame.h"
#include "mjsense/observe/touches.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/policies/planner/collision.h"

namespace mjsense::tasks::policies {

class MotionQuality {
 public:
  // Measured at the joints of all arms.
  double speed = 0;         // rad/s, maximum
  double acceleration = 0;  // rad/s^2, maximum between two control steps
  std::string accelerated;  // the joint of that acceleration, and its time
  double depth = 0;         // m, maximum penetration of a contact of the robot with the scene
  std::string deepest;      // the bodies of that contact, and its time
  int self_collisions = 0;  // number of control steps with a self-collision of the robot
  std::string met;          // the last self-collision
  // Maxima of commands: joints of arms (rad/s, rad/s^2); a mobile or floating base (m/s, m/s^2,
  // rad/s, rad/s^2).
  struct Greatest {
    double value = 0, at = 0;  // at: s
    int phase = 0;             // of the policy at that time
    void see(double v, double time, int now) {
      if (v > value) *this = {v, time, now};
    }
  };
  Greatest joint_speed, joint_acceleration, base_speed, base_acceleration, base_turn,
      base_turn_acceleration;

  MotionQuality(const mjModel* model, const robots::Robot& robot) {
    std::vector<int> joints;
    for (const robots::MoveGroup& group : robot.groups()) {
      if (group.kind != robots::GroupKind::kArm) continue;
      joints.insert(joints.end(), group.joints.begin(), group.joints.end());
      dofs_.insert(dofs_.end(), group.dofs.begin(), group.dofs.end());
    }
    robot_ = &robot;
    model_ = std::make_unique<CollisionModel>(model, robot, joints);
    root_ = model->body_rootid[robot.base_body()];
  }

  // Call before the first step: the present state counts as the last command.
  void begin(const World& world) {
    robots::RobotValues now;
    robot_->read_qpos(world, now);
    commands_.assign(1, now);
    commands_.push_back(now);
    time_ = world.time();
  }

  // `action`: the policy's action of the last step; null: commands are not measured.
  void look(const World& world, const robots::Action* action = nullptr, int phase = 0) {
    if (action) look_at_commands(world, *action, phase);
    const mjModel* m = world.model;
    const double time = world.time();
    for (std::size_t i = 0; i < dofs_.size(); ++i) {
      const double v = world.data->qvel[dofs_[i]];
      speed = std::max(speed, std::abs(v));
      if (time <= last_time_ || last_.size() != dofs_.size()) continue;
      const double a = std::abs(v - last_[i]) / (time - last_time_);
      if (a <= acceleration) continue;
      acceleration = a;
      accelerated = scene::name_of(m, mjOBJ_JOINT, m->dof_jntid[dofs_[i]]) + " at " +
                    std::to_string(time) + " s in phase " + std::to_string(phase);
    }
    last_.resize(dofs_.size());
    for (std::size_t i = 0; i < dofs_.size(); ++i) last_[i] = world.data->qvel[dofs_[i]];
    last_time_ = time;
    observe::each_touch(world, root_, [&](const observe::Touch& touch) {
      if (-touch.contact->dist <= depth) return;
      depth = -touch.contact->dist;
      deepest = scene::name_of(m, mjOBJ_BODY, touch.own) + " in " +
                scene::name_of(m, mjOBJ_BODY, touch.other) + " at " + std::to_string(time) +
                " s in phase " + std::to_string(phase);
    });
    CollisionQuery query(*model_, world);
    for (int body = 1; body < m->nbody; ++body) {
      if (m->body_rootid[body] != root_ && m->body_parentid[body] == 0) query.ignore(body);
    }
    query.ignore(0);
    if (query.free_here()) return;
    const auto gripper = [&](int geom) {
      for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
        const robots::MoveGroup& group = robot_->groups()[g];
        if (group.kind == robots::GroupKind::kGripper &&
            observe::is_descendant_or_self(m, m->geom_bodyid[geom], group.root_body))
          return static_cast<int>(g);
      }
      return -1;
    };
    const int one = gripper(query.touching().first);
    if (one >= 0 && one == gripper(query.touching().second)) return;  // fingers of a closed gripper
    ++self_collisions;
    const auto link = [&](int geom) { return scene::name_of(m, mjOBJ_BODY, m->geom_bodyid[geom]); };
    met = link(query.touching().first) + " and " + link(query.touching().second) + " at " +
          std::to_string(time) + " s in phase " + std::to_string(phase);
  }

 private:
  void look_at_commands(const World& world, const robots::Action& action, int phase) {
    const double dt = world.time() - time_;
    time_ = world.time();
    robots::RobotValues next = commands_[1];
    for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
      const robots::MoveGroup& group = robot_->groups()[g];
      const robots::GroupValues& given = action.commands[g];
      const bool free_base = group.kind == robots::GroupKind::kBase && group.command_size == 7;
      if (group.kind != robots::GroupKind::kArm && group.kind != robots::GroupKind::kBase) continue;
      if (free_base) {
        if (given.given) next[g].set(given.view());
        look_at_pose(commands_[0][g], commands_[1][g], next[g], dt, phase);
        continue;
      }
      if (!group.targets_are_qpos()) continue;
      // A group without a command holds its position.
      const robots::GroupValues& target = robot_->targets(world.id)[g];
      if (given.given) {
        next[g].set(given.view());
      } else if (commands_given_[g] && target.size == next[g].size) {
        next[g].set(target.view());
      }
      commands_given_[g] = given.given;
      for (int i = 0; i < next[g].size; ++i) {
        const double a = commands_[0][g].values[i], b = commands_[1][g].values[i],
                     c = next[g].values[i];
        const double v = std::abs(c - b) / dt, acc = std::abs(c - 2 * b + a) / (dt * dt);
        const bool turns = i == 2;
        if (group.kind == robots::GroupKind::kArm) {
          joint_speed.see(v, time_, phase);
          joint_acceleration.see(acc, time_, phase);
        } else {
          (turns ? base_turn : base_speed).see(v, time_, phase);
          (turns ? base_turn_acceleration : base_acceleration).see(acc, time_, phase);
        }
      }
    }
    commands_[0] = commands_[1];
    commands_[1] = next;
  }
  void look_at_pose(const robots::GroupValues& a, const robots::GroupValues& b,
                    const robots::GroupValues& c, double dt, int phase) {
    const auto pose = [](const robots::GroupValues& v) {
      return Pose{vec3(v.values.data()), quat(v.values.data() + 3)};
    };
    const auto turn = [&](const robots::GroupValues& from, const robots::GroupValues& to) {
      return (1 / dt) * rotate(pose(from).q, log3(conjugate(pose(from).q) * pose(to).q));
    };
    const Vec3 v = (1 / dt) * (pose(c).p - pose(b).p), before = (1 / dt) * (pose(b).p - pose(a).p);
    base_speed.see(norm(v), time_, phase);
    base_acceleration.see(norm(v - before) / dt, time_, phase);
    const Vec3 w = turn(b, c), last = turn(a, b);
    base_turn.see(norm(w), time_, phase);
    base_turn_acceleration.see(norm(w - last) / dt, time_, phase);
  }

  const robots::Robot* robot_ = nullptr;
  std::vector<robots::RobotValues> commands_;  // the last two
  std::array<bool, robots::RobotValues::kMaxGroups> commands_given_{};
  double time_ = 0;
  std::unique_ptr<CollisionModel> model_;
  std::vector<int> dofs_;
  std::vector<double> last_;
  double last_time_ = 1e9;
  int root_;
};

}  // namespace mjsense::tasks::policies
