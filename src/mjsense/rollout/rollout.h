// SPDX-License-Identifier: Apache-2.0
#pragma once
// B worlds that play episodes of a task, in lock step: the loop under recording, gym environments
// and benchmarks.
//
//   Rollout rollout(cfg);
//   rollout.start(worlds, episodes);   observation 0 of these episodes is fresh
//   while (...) {
//     rollout.act();                   the policy's actions; or write rollout.action(w) yourself
//     rollout.step();                  apply -> controllers -> physics -> sensors -> judgement
//     rollout.suite(), rollout.evaluation(w), rollout.fault(w)
//   }
//
// An episode is a function of (seed, number): it does not depend on B, on its world, on threads, or
// on what ran beside it.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/fields.h"
#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"
#include "mjsense/observe/suite.h"
#include "mjsense/rollout/action_log.h"
#include "mjsense/rollout/core_suite.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {

struct RolloutCfg {
  std::string task = "pick";
  std::string robot = "franka";
  std::string policy = "planner";
  int num_worlds = 1;
  int threads = 0;
  std::uint64_t seed = 0;
  std::optional<std::vector<std::string>> cameras;
  std::optional<int> width, height;
  bool depth = false;
  int samples = 1;
  bool shadows = true;
  std::optional<int> horizon;
  bool action_noise = true;
  // Makes further sensors for the suite, recorded like the others.
  std::function<std::vector<std::shared_ptr<Sensor>>(const std::shared_ptr<Simulation>&)>
      more_sensors;
};
template <class V>
void visit_fields(V& v, RolloutCfg& c) {
  v.object("RolloutCfg", "Worlds that play episodes of a task.");
  v("task", c.task, "Which task.").decides_data();
  v("robot", c.robot, "Which robot.").decides_data();
  v("policy", c.policy, "What drives it.").decides_data();
  v("num_worlds", c.num_worlds, "How many run at one time.").option("worlds").at_least(1);
  v("threads", c.threads, "Of the simulation; 0: every CPU this process may use.").at_least(0);
  v("seed", c.seed, "Same seed, same episodes.").decides_data();
  v("cameras", c.cameras,
    "Names of the robot's cameras, in this order; by default all, none for an empty list.")
      .decides_data_as("cameras");
  v("width", c.width, "Of pictures; by default the robot's.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("height", c.height, "Of pictures; by default the robot's.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("depth", c.depth, "Also the depth of every camera, losslessly.").decides_data_as("cameras");
  v("samples", c.samples, "Rays a pixel of rgb: smooth edges for time.").at_least(1).decides_data();
  v("shadows", c.shadows, "Pictures have shadows.").decides_data();
  v("horizon", c.horizon, "Control steps after which an episode is cut; by default the task's.")
      .at_least(1)
      .decides_data_as("horizon");
  v("action_noise", c.action_noise, "Commands reach the arm with noise.")
      .option("noise")
      .decides_data();
}

// Where the time of steps went, wall seconds.
struct RolloutTimes {
  double policy = 0;     // act(): planning, inverse kinematics, controllers
  double physics = 0;    // MuJoCo
  double sensing = 0;    // rows
  double rendering = 0;  // cameras and rays
  double reset = 0;      // start(): sampling, first plans, first observations
};

class Rollout {
 public:
  // Throws KeyError for an unknown task, robot, policy or camera, ValueError for bad sizes.
  explicit Rollout(const RolloutCfg& cfg);
  ~Rollout();
  Rollout(const Rollout&) = delete;
  Rollout& operator=(const Rollout&) = delete;

  const RolloutCfg& cfg() const { return cfg_; }
  int num_worlds() const { return cfg_.num_worlds; }
  Task& task() { return *task_; }
  Policy* policy() { return policy_.get(); }
  Simulation& simulation() { return *simulation_; }
  const std::shared_ptr<Simulation>& simulation_ptr() const { return simulation_; }
  SensorSuite& suite() { return suite_; }
  const std::vector<RecordedCamera>& cameras() const { return cameras_; }

  // World worlds[k] plays episode episodes[k] from its start. Its faults are forgotten.
  void start(std::span<const int> worlds, std::span<const std::int64_t> episodes);
  // This world plays nothing until it is started again; it stands still.
  void stop(int world) { active_[world] = false; }
  bool active(int world) const { return active_[world]; }
  std::int64_t episode(int world) const { return task_->episode(world); }

  // The policy fills the actions of the active worlds.
  void act();
  Action& action(int world) { return actions_[world]; }
  // One control step; then suite and evaluations of the active worlds are current.
  void step();

  const Evaluation& evaluation(int world) const { return evaluations_[world]; }
  // Why this world's episode cannot go on: physics that diverged (MuJoCo's text), a row that does
  // not fit. "" if it can. Its rows mean nothing until it is started again.
  const std::string& fault(int world) const { return faults_[world]; }
  // The fault is a row that does not fit: nothing of this episode may be kept.
  bool refused(int world) const { return refused_[world]; }

  const RolloutTimes& times() const { return times_; }

 private:
  class EachActive;
  std::span<const int> active_worlds();
  void for_each(std::span<const int> worlds, std::function<void(const World&)> body);
  bool guard_rows(const std::function<void()>& body);
  void observe();
  void take_failures();
  void set_fault(int world, std::string text);
  double row_cost() const;
  double cast_cost() const;
  int threads() const;

  RolloutCfg cfg_;
  std::unique_ptr<Task> task_;
  std::unique_ptr<Policy> policy_;
  std::vector<RecordedCamera> cameras_;
  std::unique_ptr<ActionLog> log_;
  SensorSuite suite_;
  std::shared_ptr<Simulation> simulation_;  // refers to the suite's sensors
  std::vector<Action> actions_;
  std::vector<Evaluation> evaluations_;
  std::vector<std::string> faults_;
  std::vector<char> active_, refused_;
  std::vector<StateRow> rows_;  // [B]
  std::vector<int> ids_;        // scratch of active_worlds()
  RolloutTimes times_;
};

}  // namespace mjsense
