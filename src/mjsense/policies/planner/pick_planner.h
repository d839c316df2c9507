// SPDX-License-Identifier: Apache-2.0
#pragma once
// Picks up the target of a task that has a GraspScene: open, pregrasp, grasp, settle, close, lift. Waypoints are
// timed by simulation time; the tool moves on screws between them; inverse kinematics follows from
// the last command.

#include <vector>

#include "mjsense/episode/grasp_scene.h"
#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"
#include "mjsense/policies/planner/grasp.h"

namespace mjsense {

struct PickPlannerCfg {
  double fast = 0.20, slow = 0.08;        // m/s, of the tool
  double pregrasp_height = 0.04;          // m above the grasp, world z
  double lift_height = 0.08;              // m above the grasp, world z
  double settle = 0.1, close_time = 0.5;  // s
  double max_position_error = 0.1;        // m, tool against its target
  double max_rotation_error = 0.5236;     // rad (30 degrees)
  double min_held_opening = 0.002;        // m: less between the fingers means nothing is held
  int max_ik_failures = 8;                // in a row
  int max_retries = 3;
  int max_ik_candidates = 256;  // grasps tried before giving up
};

class PickPlanner final : public PlannerPolicy {
 public:
  explicit PickPlanner(PickPlannerCfg cfg = {}) : cfg_(cfg) {}
  std::string_view name() const override { return "planner"; }
  void initialize(Task& task) override;  // throws ValueError for a task without one
  void reset(const World& world) override;
  void act(const World& world, Action& action) override;

  std::span<const Phase> phases() const override;
  int phase(int world) const override { return plans_[world].phase; }
  int num_retries(int world) const override { return plans_[world].retries; }
  Pose grasp_pose(int world) const override { return plans_[world].grasp; }

 private:
  // One leg of a plan: the tool goes from `from` to `to` (base frame) and waits, or stays while the
  // gripper moves.
  struct Leg {
    int phase = 0;
    Pose from;
    Twist screw;          // log6(from^-1 to)
    double move = 0;      // s
    double duration = 0;  // s, move and wait
    double gripper = 0;   // command during the leg
  };
  static constexpr int kLegs = 5;
  struct Plan {
    Leg legs[kLegs];
    int leg = 0;
    double leg_start = 0;  // s, simulation time
    bool planned = false;  // false: no feasible grasp was found
    bool finished = false;
    int phase = 0;
    int retries = 0;
    int ik_failures = 0;
    Pose grasp{{0, 0, 0}, {0, 0, 0, 0}};        // world; zeros before the first plan
    Pose target;                                // base frame, of the last command
    std::array<double, Chain::kMaxJoints> q{};  // last command of the arm
  };
  void plan(const World& world, Plan& plan) const;
  bool choose_grasp(const World& world, Grasp& chosen) const;
  bool reachable(const Pose& base, const Pose& grasp, std::span<const double> q) const;
  bool path_is_free(const World& world, const Pose& tool, const Pose& pregrasp) const;
  bool failed(const World& world, const Plan& plan) const;
  void read_arm(const World& world, std::span<double> q) const;

  PickPlannerCfg cfg_;
  const Task* task_ = nullptr;
  const GraspScene* scene_ = nullptr;
  std::unique_ptr<GripperShape> gripper_shape_;
  std::vector<Plan> plans_;  // [B]
};

}  // namespace mjsense
