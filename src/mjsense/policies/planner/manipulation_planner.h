// SPDX-License-Identifier: Apache-2.0
#pragma once
// Picks up the target of a task that has a GraspScene, from any direction, and puts it where the task's PlaceScene
// says. The way to the object is free of everything, the object in the hand included. With several hands the
// nearest takes it. The plan has stages: pick; place, from where the object is in the hand; a look at
// whether it is done - if not, it begins again.

#include <memory>
#include <mutex>
#include <vector>

#include "mjsense/episode/grasp_scene.h"
#include "mjsense/policies/planner/grasp.h"
#include "mjsense/policies/planner/hand_planner.h"
#include "mjsense/policies/planner/task_planner.h"

namespace mjsense {

struct ManipulationPlannerCfg {
  TaskPlannerCfg planner;
  HandPlannerCfg hand;
  double fast = 0.20, slow = 0.08;              // m/s, of the tool on lines
  double pregrasp = 0.04;                       // m before the grasp, against the approach
  double lift = 0.08;                           // m above the grasp
  double settle = 0.1, close_time = 0.5;        // s
  double preplace = 0.07;                       // m above the place
  double clearance = 0.005;                     // m between object and place when it is let go
  double place_settle = 0.5, open_time = 0.25;  // s
  double retreat = 0.05;                        // m, against the approach
  double rest = 2.0;                            // s at the end
  double most_tilt = 90;        // degrees from above; the approach asked for is drawn up to here
  int max_ik_candidates = 256;  // grasps tried before giving up
  int max_far_candidates =
      60;            // of them with a search far from the present joints, if none is near
  int max_ways = 6;  // of them with a search for a way
};

class ManipulationPlanner final : public TaskPlanner {
 public:
  explicit ManipulationPlanner(ManipulationPlannerCfg cfg = {})
      : TaskPlanner(cfg.planner), cfg_(cfg) {}
  std::span<const Phase> phases() const override;

 protected:
  void initialize_planner() override;  // throws ValueError without a GraspScene or a hand
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;
  bool gone_wrong(const World& world) const override;

 private:
  struct State {
    int hand = 0;
    bool holding = false;
    Pose tool_object;          // X_TO in the hand
    RobotValues home;          // joints at the start of the episode
    Pose home_tool;            // X_WT
    std::vector<Pose> failed;  // X_OT, grasps of this episode that did not hold, or not to the end
  };
  void let_go(Plan& plan) const;
  void plan_pick(const World& world, const PlanRequest& request, Plan& plan);
  // With `to_place` only a grasp with which the object also gets to where it is wanted.
  bool pick_with(const World& world, const PlanRequest& request, int hand, bool to_place,
                 Plan& plan);
  bool can_place(const World& world, const HandPlanner& hand, const HandPose& at) const;
  // X_WO of the object at a place, turned the k-th way from how it hangs at X_WO.
  Pose placed(const Pose& object, int target, Vec3 place, int k) const;
  bool lift(const World& world, HandPlanner& hand, const HandPose& at, Plan& plan) const;
  void plan_place(const World& world, const PlanRequest& request, Plan& plan);
  bool place_at(const World& world, HandPlanner& hand, CollisionQuery& query, const HandPose& start,
                const Pose& object, const Pose& tool_object, Rng& rng, Plan& plan);
  void go_home(const World& world, HandPlanner& hand, const HandPose& from, const Pose& object,
               Rng& rng, Plan& plan) const;
  std::span<const Grasp> grasps(int object, int hand);
  Pose object_pose(const World& world) const;
  int target_body(int world) const { return scene_->all_objects()[scene_->target(world)].body; }
  Rng rng(const World& world, const PlanRequest& request, std::string_view what) const;

  ManipulationPlannerCfg cfg_;
  const GraspScene* scene_ = nullptr;
  std::vector<std::unique_ptr<HandPlanner>> hands_;
  std::vector<GripperShape> grippers_;  // [hands]
  struct Grasps {
    std::once_flag once;
    std::vector<Grasp> of_object;
  };
  std::vector<std::unique_ptr<Grasps>> grasps_;  // [objects, hands], made when they are needed
  std::vector<State> states_;                    // [B]
};

}  // namespace mjsense
