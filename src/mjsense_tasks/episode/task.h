// SPDX-License-Identifier: Apache-2.0
#pragma once
// Interface of tasks: the scene, the episodes and the success criterion. Order of the calls:
//
//   scene_cfg_with_robot()        before compilation: scene_cfg() (furniture, objects, lights) and the
//                            robot
//   bind(simulation)         if there is a simulation
//   initialize(model, B)     after compilation: resolves names; robot() is valid from here on
//   register_policy(policy)  once
//   start of an episode:     sample(w, episode, state), forward, begin_all, policy.reset_all,
//                            observe
//   control step:            policy.act_all, apply(world, action, state), advance, step, observe,
//                            evaluate_all
//
// State is stored per world. Functions that take a world access that world only, and may run in
// parallel for different worlds. A task that evaluates all worlds at once overrides the *_all
// functions, whose defaults call those of one world.

#include <mujoco/mujoco.h>

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

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense/core/text/json.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/episode/active_worlds.h"
#include "mjsense_tasks/episode/given_start.h"
#include "mjsense_tasks/episode/perturbation.h"
#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/robots/scene_robot.h"

namespace mjsense::observe {
class SensorSuite;
}  // namespace mjsense::observe

namespace mjsense::tasks::scenes {
struct SceneFileCfg;
}  // namespace mjsense::tasks::scenes

namespace mjsense::sim {
class Simulation;
}  // namespace mjsense::sim

namespace mjsense::tasks {
class MultiTask;
}  // namespace mjsense::tasks

namespace mjsense::tasks::episode {

class GraspScene;
class Policy;

// Sentences of an episode's instruction: paraphrases that differ between episodes, or description().
enum class Instructions { kVaried, kCanonical };
constexpr std::array<std::string_view, 2> enum_names(Instructions) {
  return {"varied", "canonical"};
}

struct TaskCfg {
  robots::RobotCfg robot;  // without a name: the robot in the task's scene, if any
  std::string scene;       // name or file; "": the task's own scene
  // Creates a scene that replaces a named one; `scene` is then only a display name.
  std::function<scenes::SceneFileCfg()> make_scene;
  std::uint64_t seed = 0;
  int horizon = 500;      // policy steps after which an episode is truncated
  int policy_dt_ms = 66;  // ms, period of the policy's actions
  int ctrl_dt_ms = 0;     // ms, period of the robot's controllers; 0: as sim_dt_ms
  int sim_dt_ms = 2;      // ms, period of the physics
  bool action_noise = true;
  bool terminate_upon_success = false;
  // Share of episodes that are perturbed on purpose (perturbation.h).
  double perturb = 0;
  NamedEnum<Instructions> instructions;
  GivenStarts starts;  // episodes of other numbers are sampled
};

// An object with a role in an episode, such as "pickup_obj".
struct TaskObject {
  std::string role;
  int body = -1;
  std::string name;   // display name: "mug"
  bool thin = false;  // a handle, a wire: its image points may be on its rim
};

// The task's evaluation of one observation.
struct Evaluation {
  double reward = 0;
  bool success = false;  // of this observation, not latched
  // The task has ended the episode, the policy has reported done, or it is a success with
  // terminate_upon_success.
  bool terminal = false;
  bool truncated = false;  // the horizon is reached
  // What is missing for a success, in a few words with static lifetime: "the object is not lifted".
  // The same reason always has the same words, so that they can be counted. "" if the task does not
  // give a reason.
  std::string_view missing;
};

// A referring expression with a weight, as in referral_expressions of obs_scene.
struct Referral {
  std::string text;
  double probability = 1;
};

class Task {
 public:
  explicit Task(TaskCfg cfg);  // throws ValueError for invalid periods or horizon
  virtual ~Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  const TaskCfg& cfg() const { return cfg_; }
  virtual std::string_view name() const = 0;  // name in the registry
  virtual std::string_view type() const = 0;  // task_type of obs_scene: "pick"
  // Physics steps per policy step, and per controller step.
  int decimation() const { return cfg_.policy_dt_ms / cfg_.sim_dt_ms; }
  int control_decimation() const { return cfg_.ctrl_dt_ms / cfg_.sim_dt_ms; }
  double fps() const { return 1000.0 / cfg_.policy_dt_ms; }

  // The scene without the robot of cfg(); the caller adds sensors. If the scene has an entity
  // "robot_0" without a model, the robot takes its place among the entities; else it is added last.
  virtual scene::SceneCfg scene_cfg() const = 0;
  // The scene with the robot and the timestep of cfg().
  scene::SceneCfg scene_cfg_with_robot() const;
  // The entity of scene_cfg() that is the robot if cfg() names none; "": everything that has
  // actuators.
  virtual std::string robot_entity() const { return "robot_0"; }
  // Name patterns of that robot's actuators for each move group; empty: one group of all actuators.
  virtual robots::ActuatorGroups robot_groups() const { return {}; }
  // Full names of the scene's cameras that an episode records, in addition to the robot's.
  virtual std::vector<robots::CameraMount> cameras() const { return {}; }
  // Keyframe from which episodes start, before sample(); -1: the model's defaults.
  virtual int start_key() const { return -1; }

  // The simulation in which the task runs. Called before initialize(), if there is a simulation.
  virtual void bind(const std::shared_ptr<sim::Simulation>& /*simulation*/) {}
  void initialize(const mjModel* model, int num_worlds);
  // Sets the seed of all further episodes.
  void reseed(std::uint64_t seed) { cfg_.seed = seed; }
  const mjModel* model() const { return model_; }
  int num_worlds() const { return num_worlds_; }
  robots::Robot& robot() { return whole_ ? whole_->robot() : *robot_; }
  const robots::Robot& robot() const { return whole_ ? whole_->robot() : *robot_; }

  // Throws ValueError "Policy already registered" on a second call. The policy must outlive the
  // task.
  void register_policy(Policy& policy);
  Policy* policy() const { return whole_ ? whole_->policy() : policy_; }

  // --- one episode of one world
  // Writes the start state of episode number `episode`. It is a function of (cfg.seed, episode) and
  // does not depend on the world. `draw` > 0 gives another start state, if the ones before cannot
  // be played.
  void sample(int world, std::int64_t episode, const robots::StateRow& state, int draw = 0);
  // The given start of this world's episode; null: it was sampled.
  const GivenStart* given_start(int world) const;
  // The thresholds of success that a given start can replace, by MolmoSpaces' names.
  virtual std::map<std::string, double> thresholds() const { return {}; }
  // A threshold of success: that of the given start, or `otherwise`.
  double threshold(int world, std::string_view name, double otherwise) const;
  // Called after forward(). Stores what the episode is evaluated against (start poses), sets the
  // controllers' targets and resets the step count.
  virtual void begin(const World& world);
  // Counts the step, stores the action, sets targets and writes ctrl (with noise keyed by seed,
  // episode and step).
  void apply(const World& world, const robots::Action& action, const robots::StateRow& state);
  virtual Evaluation evaluate(const World& world) const = 0;

  // Why the start state in this world, whose data is current, cannot be played; "" if it can. The
  // rollout then draws another one, a limited number of times.
  virtual std::string start_error(const World& /*world*/) const { return ""; }

  // --- all active worlds at once, on the caller's thread
  virtual void begin_all(ActiveWorlds& worlds);
  // Called when the actions are applied, before the worlds are stepped.
  virtual void advance() {}
  // Fills the evaluations of the active worlds; `out` has an element for every world of the
  // simulation.
  virtual void evaluate_all(ActiveWorlds& worlds, std::span<Evaluation> out);
  // True if write_info() uses results of evaluate_all() and must be called after it.
  virtual bool info_follows_evaluation() const { return false; }

  std::int64_t episode(int world) const { return now(world).number; }
  int episode_step(int world) const { return now(world).step; }
  bool done_received(int world) const { return now(world).done; }
  // The perturbation of this world's episode.
  const Perturbation& perturbation(int world) const { return now(world).perturbation; }
  // The action from the policy, before clipping and noise; null before the first action.
  const robots::Action* last_action(int world) const {
    return now(world).step > 0 ? &now(world).action : nullptr;
  }

  // --- contents of observations and recordings
  // The main object first. Roles are the same in every episode and known after initialize(); bodies
  // may change.
  virtual std::span<const TaskObject> objects(int world) const = 0;
  virtual std::string description(int world) const = 0;  // "Pick up the mug"
  // The instruction of the episode: one of the task's paraphrases, or the description. A function of
  // (cfg.seed, episode).
  std::string instruction(int world) const;
  // Bodies with a free joint that are absent from some episodes, and whether one of them is present
  // in this world's episode. Absent bodies are held far away.
  virtual std::vector<int> absentees() const { return {}; }
  virtual bool present(int /*world*/, int /*body*/) const { return true; }
  // Name of the light of the world's episode, stored in obs_scene(); empty if it does not vary.
  virtual std::string light(int /*world*/) const { return {}; }
  using Referrals = std::vector<std::pair<std::string, std::vector<Referral>>>;  // by role
  virtual Referrals referrals(int world) const = 0;
  // Pose of the object with this role at the first observation, and its goal pose. Both throw
  // KeyError.
  virtual Pose start_pose(int world, std::string_view role) const = 0;
  virtual std::optional<Pose> goal_pose(int world, std::string_view role) const = 0;
  // Writes the members of task_info, sorted by key; the caller opens and closes the object.
  virtual void write_info(const World& world, JsonWriter& json) const = 0;
  // obs_scene: JSON text with task_type, task_description, policy_dt_ms, referral_expressions,
  // policy_phases and the task's own keys.
  std::string obs_scene(int world) const;

  // The tasks of which this one consists; success in any of them is a success of this task. Empty
  // for all other tasks.
  virtual std::span<const std::unique_ptr<Task>> children() const { return {}; }

  // For grasp planners; null if nothing has to be grasped.
  virtual const GraspScene* grasp_scene() const { return nullptr; }

  // Sensors beyond the core ones that this task records (obj_start, grasp_state_*, obj_end). They
  // refer to this task.
  virtual std::vector<std::shared_ptr<Sensor>> create_task_sensors() const = 0;
  // Edits the complete suite before it is bound: a task may remove sensors or change their order.
  virtual void edit_suite(observe::SensorSuite& /*suite*/) const {}

 protected:
  virtual void initialize_task() = 0;  // model() and robot() are valid
  // Writes the start state of everything except the joints of cfg()'s robot, and of these too if
  // samples_robot() is true. Returns the pose of the robot's base, or nothing to use the model's.
  virtual std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) = 0;
  virtual bool samples_robot() const { return false; }
  // Draws a sentence that describes the episode, whose start state is that of `world`; "": there is
  // only description(). The form of the sentence is that of sentence_index().
  virtual std::string paraphrase(const World& /*world*/, Rng& /*rng*/) const { return ""; }
  // Index in [0, count) of the sentence of this world's episode: `count` consecutive episodes use
  // each of them once, in random order.
  std::size_t sentence_index(int world, std::size_t count) const;
  // In a state that another task has sampled: chooses the goal of the episode without moving
  // anything. Throws ValueError if the task does not support it.
  virtual void choose_goal(int world, Rng& rng, const robots::StateRow& state);
  // In a state with the bodies, joints and robot of a given start: makes its objects those of the
  // episode, and removes absent ones. Throws ValueError if the task does not support it.
  virtual void adopt(int world, const GivenStart& start, const robots::StateRow& state);
  // Further members of obs_scene with text values, in this order.
  virtual std::vector<std::pair<std::string, std::string>> scene_info(int world) const {
    (void)world;
    return {};
  }
  // Returns an evaluation, with terminal and truncated set. `over`: the task ends the episode for a
  // reason of its own.
  Evaluation make_evaluation(int world, double reward, bool success, bool over = false) const;
  // The same, where `missing` says what is missing for a success; "": it is a success.
  Evaluation make_evaluation_from(int world, double reward, std::string_view missing) const;

 private:
  friend class tasks::MultiTask;  // this task may be a part of one
  struct Episode {
    std::int64_t number = 0;
    int step = 0;
    bool done = false;
    robots::Action action;
    Perturbation perturbation;
    std::string paraphrase;
  };
  // A stream of random numbers that differs between tasks. A task that consists of others uses those
  // of the first one, whose episodes it plays.
  std::uint32_t stream(std::string_view what) const;
  const Episode& now(int world) const { return whole_ ? whole_->now(world) : episodes_[world]; }

  TaskCfg cfg_;
  const mjModel* model_ = nullptr;
  int num_worlds_ = 0;
  std::unique_ptr<robots::Robot> robot_;
  Policy* policy_ = nullptr;
  // If this task is a part of another one: that task. Its robot, policy and episodes are used.
  Task* whole_ = nullptr;
  std::vector<Episode> episodes_;
};

}  // namespace mjsense::tasks::episode
