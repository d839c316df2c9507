// SPDX-License-Identifier: Apache-2.0
#pragma once
// Plays episodes of a task in B worlds in lock step. This is the loop of recordings, gym
// environments and benchmarks.
//
//   Rollout rollout(cfg);
//   rollout.start(worlds, episodes);   observation 0 of these episodes is fresh
//   while (...) {
//     rollout.act();                   the policy's actions; or write rollout.action(w) yourself
//     rollout.step();                  apply -> controllers -> physics -> sensors -> evaluation
//                                      or step_chunk(actions): steps, sensors after the last one
//     rollout.suite(), rollout.evaluation(w), rollout.fault(w)
//   }
//
// An episode is a function of (seed, number). It does not depend on B, on its world, on threads, or
// on the episodes in other worlds.

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/observe/suite.h"
#include "mjsense/sensors/camera/image_cfg.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/cameras/camera_system.h"
#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/rollout/action_log.h"
#include "mjsense_tasks/rollout/contact_depth.h"
#include "mjsense_tasks/rollout/core_suite.h"
#include "mjsense_tasks/rollout/registry.h"

namespace mjsense::tasks::policies {
class StartReach;
}  // namespace mjsense::tasks::policies

namespace mjsense::tasks::rollout {

class ReplaySensor;
class Rollout;

// Geometry with which robots are drawn: built-in primitive shapes, real meshes from other packages,
// or real meshes if they are available ("auto").
inline constexpr std::array<std::string_view, 3> kMeshes{"auto", "shapes", "real"};

// Part of the scene for tests of generalisation; "": all of it.
inline constexpr std::array<std::string_view, 3> kSplits{"", "train", "test"};

// A camera next to the robot that looks at the workspace in front of it, or, if it does not see the
// robot and the task's objects from there, around them. In a scene that contains its own robot, it
// is at the origin until its pose is set.
inline constexpr std::string_view kDefaultView = "default_view";

// Value of RolloutCfg::robot for the task's default robot.
inline constexpr std::string_view kTaskRobot = "auto";

struct RolloutCfg : sensors::ImageCfg {
  std::string task = "pick";
  std::string robot{kTaskRobot};
  std::string arm_controller;
  std::string scene;
  std::string split;  // one of kSplits
  std::string backdrop;
  std::string policy = "planner";
  int num_worlds = 1;
  int threads = 0;
  std::uint64_t seed = 0;
  std::string camera_system;
  std::optional<std::vector<std::string>> cameras;
  std::string meshes = "auto";  // one of kMeshes
  std::optional<int> horizon, policy_dt_ms;
  bool action_noise = true;
  bool terminate_upon_success = false;
  std::optional<double> max_penetration;
  double perturb = 0;
  NamedEnum<episode::Instructions> instructions;
  // Starts of episodes that replace the sampled ones, as JSON text (episode/given_start.h).
  std::string starts;
  bool use_sensors = true;
  // User-defined factories, used instead of a named task, policy or scene. `task`, `policy` and
  // `scene` above are then only display names.
  TaskFactory make_task;
  PolicyFactory make_policy;
  std::function<scenes::SceneFileCfg()> make_scene;
  // Dependencies of these functions and of `more_sensors`: checksums of code and of the values that
  // it uses, by name, for "task", "policy", "sensor 'x'" ... A recording can only be resumed with
  // equal ones.
  std::map<std::string, std::map<std::string, std::string>> code;
  // Adds a camera sensor kDefaultView to the scene, which the suite does not contain.
  bool default_view = false;
  // Adds replay_sensor(), whose rows are updated with those of the suite.
  bool replay_sensor = false;
  // Creates further sensors for the suite, recorded like the others. Called during construction of
  // the rollout, when task, policy, simulation, cameras and the previous sensors of the suite exist.
  std::function<std::vector<std::shared_ptr<Sensor>>(Rollout&)> more_sensors;
  // The same for sensors of the robot that are written in Python. They precede those of the policy.
  std::function<std::vector<std::shared_ptr<Sensor>>(Rollout&)> robot_sensors;
  // Edits the suite after everything else.
  std::function<void(observe::SensorSuite&)> edit_suite;
  // `on_construct_begin` is called when only task and policy exist, `on_constructed` at the end of
  // the construction.
  std::function<void(Rollout&)> on_construct_begin, on_constructed;
};
template <class V>
void visit_fields(V& v, RolloutCfg& c) {
  v.object("RolloutCfg", "Worlds that run episodes of a task.");
  v("task", c.task, "Name of the task.").decides_data();
  v("robot", c.robot,
    "Name or file of the robot. ``auto``: the task's default robot, or the first that can do the "
    "task; no robot for a task whose scene includes one.")
      .decides_data();
  v("arm_controller", c.arm_controller,
    "Controller of the robot's arms, which decides what an action is: its kind, for example "
    "``ee_delta_pose``, or a TOML table with its fields; by default that of the robot's file.")
      .decides_data();
  v("scene", c.scene, "Name or file of the scene; by default the task's.").decides_data();
  v("split", c.split,
    "Part of the scene: ``train`` or ``test``, which have no kind of object in common; the same as "
    "``@train`` or ``@test`` after the scene's name.")
      .one_of(kSplits);
  v("backdrop", c.backdrop,
    "Surroundings of the scene that are only seen, an MJCF, .glb, .gltf or .obj file: nothing "
    "touches its geoms.")
      .decides_data();
  v("policy", c.policy, "Name of the policy.").decides_data();
  v("num_worlds", c.num_worlds, "Number of worlds that run in parallel.")
      .option("worlds")
      .at_least(1);
  v("threads", c.threads, "Number of simulation threads; 0: one per available CPU.").at_least(0);
  v("seed", c.seed, "Random seed; the same seed gives the same episodes.").decides_data();
  v("camera_system", c.camera_system,
    "Name or file of the camera system; by default the cameras of the robot's model.")
      .decides_data();
  v("cameras", c.cameras,
    "Names of the cameras to render, in this order; by default all, an empty list renders none.")
      .decides_data_as("cameras");
  v.include(static_cast<sensors::ImageCfg&>(c));
  v("meshes", c.meshes,
    "Geometry used to draw the robot: ``shapes`` (primitives), ``real`` (its meshes), or ``auto``: "
    "the meshes if the robot's environment variable (``MJSENSE_FRANKA_MESHES``) names their "
    "folder. Physics is not affected.")
      .one_of(kMeshes)
      .decides_data_as("meshes");
  v("horizon", c.horizon, "Maximum number of control steps of an episode; by default the task's.")
      .at_least(1)
      .decides_data_as("horizon");
  v("policy_dt_ms", c.policy_dt_ms,
    "Duration of one action of the policy, a multiple of the controllers' period; by default the "
    "robot's or the task's. 50 ms gives 20 observations per second.")
      .unit("ms")
      .option("policy_dt")
      .at_least(1)
      .decides_data_as("policy_dt_ms");
  v("action_noise", c.action_noise, "Add noise to the commands of the arm.")
      .option("noise")
      .decides_data();
  v("perturb", c.perturb,
    "Fraction of episodes that are disturbed on purpose: the object is pushed, or slips from the "
    "gripper.")
      .within(0, 1)
      .decides_data();
  v("instructions", c.instructions,
    "Instruction of each episode. ``varied``: paraphrases that describe the objects by what "
    "distinguishes them in that episode; ``canonical``: one sentence per task and object.")
      .decides_data();
  v("terminate_upon_success", c.terminate_upon_success, "End an episode at its first success.")
      .decides_data();
  v("max_penetration", c.max_penetration,
    "Depth of a contact. After an observation with a deeper one, the episode is not a success; 0: "
    "any depth. By default 4 mm in built-in tasks, and any depth in user-defined ones. Pairs of "
    "geoms that are deeper at the start do not count.")
      .unit("m")
      .at_least(0)
      .decides_data_as("max_penetration");
  v("starts", c.starts,
    "Starts of episodes that replace the sampled ones: JSON text, an object by number of the "
    "episode.")
      .hidden();
  v("use_sensors", c.use_sensors,
    "Add the sensors of the task, of the robot and of the policy. False: only the sensors that are "
    "passed in.")
      .decides_data()
      .hidden();
}

// Replaces robot and scene by their names if they were left to the task.
RolloutCfg resolved(RolloutCfg cfg);

// Time spent in steps, wall-clock seconds.
struct RolloutTimes {
  double policy = 0;     // act(): planning, inverse kinematics, controllers
  double physics = 0;    // MuJoCo
  double sensing = 0;    // rows of sensors
  double rendering = 0;  // cameras and ray casting
  double reset = 0;      // start(): sampling, first plans, first observations
};

class Rollout {
 public:
  // Throws KeyError for an unknown task, robot, policy or camera, ValueError for bad sizes.
  explicit Rollout(const RolloutCfg& cfg);
  // Uses an existing task and policy (or null). Robot, seed, horizon and noise are those of the
  // task.
  Rollout(RolloutCfg cfg, std::shared_ptr<episode::Task> task,
          std::shared_ptr<episode::Policy> policy);
  ~Rollout();
  Rollout(const Rollout&) = delete;
  Rollout& operator=(const Rollout&) = delete;

  const RolloutCfg& cfg() const { return cfg_; }
  int num_worlds() const { return cfg_.num_worlds; }
  episode::Task& task() { return *task_; }
  episode::Policy* policy() { return policy_.get(); }
  sim::Simulation& simulation() { return *simulation_; }
  const std::shared_ptr<sim::Simulation>& simulation_ptr() const { return simulation_; }
  observe::SensorSuite& suite() { return suite_; }
  // Runs a function on the fresh data of some worlds, in parallel.
  void for_each(std::span<const int> worlds, std::function<void(const World&)> body);
  const std::vector<RecordedCamera>& cameras() const { return cameras_; }
  const Sensor* replay_sensor() const;  // null if there is none

  // Description of this world's episode for a recording, JSON text: that of the task, and the
  // camera poses if a named camera system is used.
  std::string obs_scene(int world) const;
  // The start of this world's episode, at its first observation, as RolloutCfg::starts describes it.
  std::string start_text(int world);

  // Stops all worlds. Episodes that start afterwards use this seed.
  void reseed(std::uint64_t seed);
  // Starts episode episodes[k] in world worlds[k] and clears its faults.
  void start(std::span<const int> worlds, std::span<const std::int64_t> episodes);
  // Stops this world. It does not move until it is started again.
  void stop(int world) { active_[world] = false; }
  bool active(int world) const { return active_[world]; }
  std::int64_t episode(int world) const { return task_->episode(world); }

  // Lets the policy fill the actions of the active worlds.
  void act();
  robots::Action& action(int world) { return actions_[world]; }
  // One control step. Updates the suite and the evaluations of the active worlds.
  void step();
  // Repeats a recorded control step of each of these worlds: what actions and controllers write is
  // replaced by what was written when the step was recorded. Needs cfg.replay_sensor.
  struct RecordedStep {
    int world;
    std::span<const double> written;      // row of replay/written; NaN: the current value
    std::span<const double> ctrl, mocap;  // rows of replay/ctrl and replay/mocap, or empty
  };
  void repeat(std::span<const RecordedStep> steps);
  // Control steps with these actions [steps, B]; sensors are computed only after the last one. A
  // world stops early at the end of its episode or, with `stop_on_success`, at its first success.
  // Its evaluation is that of its last step, with the sum of all rewards. Throws ValueError unless
  // there is at least one whole step.
  void step_chunk(std::span<const robots::Action> actions, bool stop_on_success = false);

  const episode::Evaluation& evaluation(int world) const { return evaluations_[world]; }
  // Reason why this world's episode cannot continue: physics that diverged (MuJoCo's message) or a
  // row that could not be computed. "" if there is none. With a fault, the world's rows are invalid
  // until its next episode starts.
  const std::string& fault(int world) const { return faults_[world]; }
  // True if the fault is a row that could not be computed: the episode must not be kept.
  bool refused(int world) const { return refused_[world]; }
  // The contact because of which this world's episode cannot succeed; "" if there is none.
  std::string deep_contact(int world) const {
    return depth_->description(world, simulation_->model());
  }

  const RolloutTimes& times() const { return times_; }

 private:
  class ForEachHook;
  class WorldSubset;
  void make();
  void make_simulation();
  void bind_task();
  void control_robot();
  void compose_suite();
  void resize_worlds();
  std::vector<std::shared_ptr<Sensor>> robot_sensors();
  std::span<const int> active_worlds();
  void move(std::span<const int> worlds, bool answers, std::span<const RecordedStep> recorded = {});
  void write_recorded(const RecordedStep& step, std::span<const double> before);
  void evaluate(std::span<const int> worlds);
  // Turns a success after a contact deeper than max_penetration into a failure.
  void refuse_deep_contacts(std::span<const int> worlds);
  void finish_rows();
  bool guard_rows(const std::function<void()>& body);
  void repeat_until_complete(const std::function<void()>& body);
  void sense();
  void take_failures();
  void check_speeds(std::span<const int> worlds);
  void sample(std::span<const int> worlds, std::span<const std::int64_t> episodes);
  void place_cameras(std::span<const int> worlds);
  void set_fault(int world, std::string text);
  double row_cost() const;
  double cast_cost() const;
  int threads() const;

  RolloutCfg cfg_;
  std::shared_ptr<episode::Policy> policy_;  // outlives the task
  std::shared_ptr<episode::Task> task_;
  std::unique_ptr<cameras::CameraSystem> camera_system_;
  std::unique_ptr<cameras::CameraSystem> view_;  // of RolloutCfg::default_view
  std::vector<RecordedCamera> cameras_;
  std::unique_ptr<policies::StartReach> reach_;  // null: any start is accepted
  std::unique_ptr<ActionLog> log_;
  std::shared_ptr<ReplaySensor> replay_;
  observe::SensorSuite suite_;
  std::shared_ptr<sim::Simulation> simulation_;  // refers to the suite's sensors
  std::vector<robots::Action> actions_;
  std::vector<episode::Evaluation> evaluations_;
  std::vector<std::string> faults_;
  std::vector<char> active_, refused_;
  std::optional<ContactDepth> depth_;
  std::vector<robots::StateRow> rows_;  // [B]
  std::vector<int> ids_;                // scratch of active_worlds()
  std::vector<int> moving_;             // scratch of start() and step_chunk()
  RolloutTimes times_;
};

}  // namespace mjsense::tasks::rollout
