// SPDX-License-Identifier: Apache-2.0
#pragma once
// Open or close something of a scene: a drawer, a door of a cabinet, a microwave, a fridge. Whatever
// articulation.h finds in the model may be the target of an episode.

#include <string>
#include <vector>

#include "mjsense/scenes/object_task.h"
#include "mjsense/tasks/opening/articulation.h"
#include "mjsense/tasks/opening/base_search.h"
#include "mjsense/tasks/opening/reach.h"

namespace mjsense {

enum class OpeningKind { kOpen, kClose };

class OpeningTask final : public ObjectTask {
 public:
  static constexpr std::string_view kRole = "pickup_obj";
  // Fractions of the range; success, and where a close begins. What is open is the robot's matter
  // (RobotCfg::opened).
  static constexpr double kClosed = 0.85;
  static constexpr double kLeastStart = 0.35, kMostStart = 0.65;

  // In cfg.scene; by default in a kitchen.
  OpeningTask(TaskCfg cfg, OpeningKind kind);
  std::string_view name() const override { return type(); }
  std::string_view type() const override { return kind_ == OpeningKind::kOpen ? "open" : "close"; }
  // An object inside something, or a target that the robot reaches from nowhere.
  std::string start_fault(const World& world) const override;

  void begin(const World& world) override;
  // Reward of open: the most of |q| / range over all things of the target's category; of close: 1 -
  // |q| / range of the target. Success: it is at least opened(), 0.85.
  Evaluation evaluate(const World& world) const override;

  std::string description(int world) const override;  // "Open the drawer"
  Referrals referrals(int world) const override;
  // The body where the joint is as far as counts.
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  // episode_step, joint_position (rad or m, of the first thing of the category), success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;

  // --- for planners
  OpeningKind kind() const { return kind_; }
  double opened() const { return robot().cfg().opened; }
  std::span<const Articulation> articulations() const { return articulations_; }
  const Articulation& target(int world) const { return articulations_[targets_[world].index]; }
  const HandleReach& reach() const { return *reach_; }
  // Whether the robot stands where its arm alone does not do it.
  bool driving(int world) const { return targets_[world].driving; }
  // Joint position that a planner brings the target to: well beyond what counts.
  double aim(const Articulation& one) const;

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const StateRow& state) override;

 private:
  struct Target {
    int index = 0;
    bool reached = true;
    bool driving = false;  // the arm alone does not do it
    Pose goal;
  };
  double reward(const World& world) const;
  bool succeeded(double reward) const;
  struct Found {
    Pose base;
    bool driving;
  };
  std::optional<Found> find_base(const Articulation& one, double from,
                                 const HandleReach::Start& start, Rng& rng) const;

  OpeningKind kind_;
  std::vector<Articulation> articulations_;
  std::unique_ptr<HandleReach> reach_;
  std::unique_ptr<BaseSearch> bases_;
  std::vector<Target> targets_;  // [B]
};

}  // namespace mjsense
