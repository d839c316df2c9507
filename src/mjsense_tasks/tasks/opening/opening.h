// SPDX-License-Identifier: Apache-2.0
#pragma once
// The open and close tasks: open or close a drawer or the door of a cabinet, microwave or fridge.
// Every articulation found by articulation.h can be the target of an episode.

#include <string>
#include <vector>

#include "mjsense_tasks/scenes/object_task.h"
#include "mjsense_tasks/tasks/opening/articulation.h"
#include "mjsense_tasks/tasks/opening/base_search.h"
#include "mjsense_tasks/tasks/opening/handle_reach.h"

namespace mjsense::tasks {

enum class OpeningKind { kOpen, kClose };

class OpeningTask final : public scenes::ObjectTask {
 public:
  static constexpr std::string_view kRole = "pickup_obj";
  // Fractions of the range: success of `close`, and the range of its start. The success threshold
  // of `open` depends on the robot (RobotCfg::opened).
  static constexpr double kClosed = 0.85;
  static constexpr double kMinStart = 0.35, kMaxStart = 0.65;

  // Plays in cfg.scene; the default scene is a kitchen.
  OpeningTask(episode::TaskCfg cfg, OpeningKind kind);
  std::string_view name() const override { return type(); }
  std::string_view type() const override { return kind_ == OpeningKind::kOpen ? "open" : "close"; }
  std::map<std::string, double> thresholds() const override;
  // Rejects starts in which an object penetrates another one, or in which the target is unreachable
  // from every base placement.
  std::string start_error(const World& world) const override;

  void begin(const World& world) override;
  // Reward of `open`: the maximum of |q| / range over all articulations of the target's category.
  // Reward of `close`: 1 - |q| / range of the target. Success: the reward is at least opened() for
  // `open`, 0.85 for `close`.
  episode::Evaluation evaluate(const World& world) const override;

  std::string description(int world) const override;  // "Open the drawer"
  Referrals referrals(int world) const override;
  // Pose of the body at the joint position where success begins.
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  // Writes episode_step, joint_position (rad or m, of the category's first articulation) and
  // success.
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override {
    return object_sensors("Pose of the drawer or door where it counts as open or closed.");
  }

  // --- for planners
  OpeningKind kind() const { return kind_; }
  double opened() const { return robot().cfg().opened; }
  std::span<const Articulation> articulations() const { return articulations_; }
  const Articulation& target(int world) const { return articulations_[targets_[world].index]; }
  const HandleReach& reach() const { return *reach_; }
  // Whether the base must drive during the motion, because the arm alone cannot complete it.
  bool driving(int world) const { return targets_[world].driving; }
  // Joint position that a planner aims at, well beyond the success threshold.
  double aim(const Articulation& one) const;

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  void adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) override;

 private:
  struct Target {
    int index = 0;
    bool reached = true;
    bool driving = false;  // the arm alone cannot complete the motion
    Pose goal;
  };
  std::vector<std::string> references(const World& world) const;
  double reward(const World& world) const;
  bool succeeded(int world, double reward) const;
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

}  // namespace mjsense::tasks
