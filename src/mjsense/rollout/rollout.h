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
//                                      or step_chunk(actions): several, sensors after the last
//     rollout.suite(), rollout.evaluation(w), rollout.fault(w)
//   }
//
// An episode is a function of (seed, number): it does not depend on B, on its world, on threads, or
// on what ran beside it.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/cameras/camera_system.h"
#include "mjsense/core/fields.h"
#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"
#include "mjsense/observe/suite.h"
#include "mjsense/rollout/action_log.h"
#include "mjsense/rollout/core_suite.h"
#include "mjsense/rollout/registry.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {

class Rollout;

// What robots are drawn with: shapes of ours, real meshes of other packages, or these where there
// are some.
inline constexpr std::array<std::string_view, 3> kMeshes{"auto", "shapes", "real"};

// For RolloutCfg::robot: that of the task.
inline constexpr std::string_view kTaskRobot = "auto";

struct RolloutCfg {
  std::string task = "pick";
  std::string robot{kTaskRobot};
  std::string scene;
  std::string policy = "planner";
  int num_worlds = 1;
  int threads = 0;
  std::uint64_t seed = 0;
  std::string camera_system;
  std::optional<std::vector<std::string>> cameras;
  std::optional<int> width, height;
  bool depth = false;
  bool segmentation = false;
  int samples = 1;
  bool shadows = true;
  std::string meshes = "auto";  // one of kMeshes
  std::optional<int> horizon;
  bool action_noise = true;
  bool terminate_upon_success = false;
  double perturb = 0;
  bool use_sensors = true;
  // Make the task, the policy and the scene instead of those with a name; `task`, `policy` and
  // `scene` above are then what people read.
  TaskFactory make_task;
  PolicyFactory make_policy;
  std::function<SceneFileCfg()> make_scene;
  // Makes further sensors for the suite, recorded like the others. The rollout is being made: task,
  // policy, simulation, cameras and the suite so far are there.
  std::function<std::vector<std::shared_ptr<Sensor>>(Rollout&)> more_sensors;
  // Called when there is nothing but task and policy, and once everything is there.
  std::function<void(Rollout&)> making, made;
};
template <class V>
void visit_fields(V& v, RolloutCfg& c) {
  v.object("RolloutCfg", "Worlds that run episodes of a task.");
  v("task", c.task, "Name of the task.").decides_data();
  v("robot", c.robot,
    "Name or file of the robot. ``auto``: the task's default robot, or the first that can do the "
    "task; no robot for a task whose scene includes one.")
      .decides_data();
  v("scene", c.scene, "Name or file of the scene; by default the task's.").decides_data_as("scene");
  v("policy", c.policy, "Name of the policy.").decides_data();
  v("num_worlds", c.num_worlds, "Number of worlds that run in parallel.")
      .option("worlds")
      .at_least(1);
  v("threads", c.threads, "Number of simulation threads; 0: one per available CPU.").at_least(0);
  v("seed", c.seed, "Random seed; the same seed gives the same episodes.").decides_data();
  v("camera_system", c.camera_system,
    "Name or file of the camera system; by default the cameras of the robot's model.")
      .decides_data_as("camera_system");
  v("cameras", c.cameras,
    "Names of the cameras to render, in this order; by default all, an empty list renders none.")
      .decides_data_as("cameras");
  v("width", c.width, "Width of the images; by default the robot's.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("height", c.height, "Height of the images; by default the robot's.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("depth", c.depth, "Add a lossless depth image for every camera.").decides_data_as("cameras");
  v("segmentation", c.segmentation,
    "Add a lossless segmentation image for every camera: (id, mjtObj) of each pixel.")
      .decides_data_as("cameras");
  v("samples", c.samples,
    "Rays per pixel of rgb; more samples give smoother edges and take longer.")
      .at_least(1)
      .decides_data();
  v("shadows", c.shadows, "Draw shadows.").decides_data();
  v("meshes", c.meshes,
    "Geometry used to draw the robot: ``shapes`` (primitives), ``real`` (its meshes), or ``auto``: "
    "the meshes if the robot's environment variable (``MJSENSE_FRANKA_MESHES``) names their "
    "folder. Physics is not affected.")
      .one_of(kMeshes)
      .decides_data_as("meshes");
  v("horizon", c.horizon, "Maximum number of control steps of an episode; by default the task's.")
      .at_least(1)
      .decides_data_as("horizon");
  v("action_noise", c.action_noise, "Add noise to the commands of the arm.")
      .option("noise")
      .decides_data();
  v("perturb", c.perturb,
    "Fraction of episodes that are disturbed on purpose: the object is pushed, or slips from the "
    "gripper.")
      .within(0, 1)
      .decides_data_as("perturb");
  v("terminate_upon_success", c.terminate_upon_success, "End an episode at its first success.")
      .decides_data_as("terminate_upon_success");
  v("use_sensors", c.use_sensors,
    "Add the sensors of the task, of the robot and of the policy. False: only the sensors that are "
    "passed in.")
      .decides_data_as("use_sensors")
      .hidden();
}

// With robot and scene by their names where they were left to the task.
RolloutCfg resolved(RolloutCfg cfg);

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
  // Of a task and a policy (or null) that exist; robot, seed, horizon and noise are the task's own.
  Rollout(RolloutCfg cfg, std::shared_ptr<Task> task, std::shared_ptr<Policy> policy);
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
  // Runs a function on the fresh data of some worlds, in parallel.
  void for_each(std::span<const int> worlds, std::function<void(const World&)> body);
  const std::vector<RecordedCamera>& cameras() const { return cameras_; }

  // What a recording says of this world's episode: the task's, and where a named camera system has
  // put its cameras. JSON text.
  std::string obs_scene(int world) const;

  // Stops all worlds; episodes started from here on are those of this seed.
  void reseed(std::uint64_t seed);
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
  // Control steps with these actions [steps, B], sensed after the last alone. A world stops early
  // where its episode ends, or with its first success if `stop_on_success`; the evaluation is that
  // of its last step, its reward the sum over all. Throws ValueError if there is no whole step.
  void step_chunk(std::span<const Action> actions, bool stop_on_success = false);

  const Evaluation& evaluation(int world) const { return evaluations_[world]; }
  // Why this world's episode cannot go on: physics that diverged (MuJoCo's text), a row that could
  // not be filled. "" if it can. Its rows mean nothing until it is started again.
  const std::string& fault(int world) const { return faults_[world]; }
  // The fault is a row that could not be filled: nothing of this episode may be kept.
  bool refused(int world) const { return refused_[world]; }

  const RolloutTimes& times() const { return times_; }

 private:
  class EachActive;
  class Some;
  void make();
  std::span<const int> active_worlds();
  void move(std::span<const int> worlds, bool answers);
  void evaluate(std::span<const int> worlds);
  void finish_rows();
  bool guard_rows(const std::function<void()>& body);
  void sense();
  void take_failures();
  void sample(std::span<const int> worlds, std::span<const std::int64_t> episodes);
  void place_cameras(std::span<const int> worlds);
  void set_fault(int world, std::string text);
  double row_cost() const;
  double cast_cost() const;
  int threads() const;

  RolloutCfg cfg_;
  std::shared_ptr<Policy> policy_;  // outlives the task
  std::shared_ptr<Task> task_;
  std::unique_ptr<CameraSystem> camera_system_;
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
  std::vector<int> moving_;     // scratch of start() and step_chunk()
  RolloutTimes times_;
};

}  // namespace mjsense
