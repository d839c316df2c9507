// SPDX-License-Identifier: Apache-2.0
#pragma once
// A task: its scene, its episodes, and what counts as done. Life:
//
//   whole_scene_cfg()        before compilation: scene_cfg() - furniture, objects, lights - and the
//                            robot
//   bind(simulation)         its worlds, where there is a simulation
//   initialize(model, B)     after compilation: resolves names; the robot exists from here on
//   register_policy(policy)  once
//   episodes of worlds:      sample(w, episode, state), forward, begin_all, policy.reset_all,
//                            observe
//   a control step:          policy.act_all, apply(world, action, state), advance, step, observe,
//                            evaluate_all
//
// State is per world; functions that take a world touch that world's alone and may run in parallel
// with the others. A task that judges all worlds at once overrides the *_all functions, whose
// defaults call those of one world.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/json.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense/episode/active_worlds.h"
#include "mjsense/episode/perturbation.h"
#include "mjsense/robots/robot.h"
#include "mjsense/robots/scene_robot.h"
#include "mjsense/scene/scene.h"

namespace mjsense {

class GraspScene;
class Policy;
class SensorSuite;
class Simulation;
struct SceneFileCfg;

struct TaskCfg {
  RobotCfg robot;     // without a name: the task's scene has its own, if any
  std::string scene;  // name or file; "": the task's own
  // Makes a scene in the place of a named one, which `scene` then is only for people.
  std::function<SceneFileCfg()> make_scene;
  std::uint64_t seed = 0;
  int horizon = 500;      // policy steps after which an episode is truncated
  int policy_dt_ms = 66;  // one action of the policy
  int ctrl_dt_ms = 0;     // one step of the robot's controllers; 0: as the physics
  int sim_dt_ms = 2;      // one physics step
  bool action_noise = true;
  bool terminate_upon_success = false;
  double perturb =
      0;  // share of episodes in which something goes wrong on purpose (perturbation.h)
};

// An object that plays a role in an episode: "pickup_obj" -> a body.
struct TaskObject {
  std::string role;
  int body = -1;
  std::string name;   // of the body, for people: "mug"
  bool thin = false;  // a handle, a wire: its image points may lie on its rim
};

// One observation's judgement.
struct Evaluation {
  double reward = 0;
  bool success = false;  // momentary, not latched
  // The task says that the episode is over, the policy has said done, or success with
  // terminate_upon_success.
  bool terminal = false;
  bool truncated = false;  // the horizon is reached
  // What a success lacks, a few words that live as long as the program: "the object is not lifted".
  // The same words for the same reason, so that they can be counted; "": the task does not say.
  std::string_view lacks;
};

// Text with a weight, as obs_scene's referral_expressions have it.
struct Referral {
  std::string text;
  double probability = 1;
};

class Task {
 public:
  explicit Task(TaskCfg cfg);  // throws ValueError for bad timing
  virtual ~Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  const TaskCfg& cfg() const { return cfg_; }
  virtual std::string_view name() const = 0;  // registry name
  virtual std::string_view type() const = 0;  // task_type of obs_scene: "pick"
  // Physics steps per policy step, and per step of the controllers.
  int decimation() const { return cfg_.policy_dt_ms / cfg_.sim_dt_ms; }
  int control_decimation() const { return cfg_.ctrl_dt_ms / cfg_.sim_dt_ms; }
  double fps() const { return 1000.0 / cfg_.policy_dt_ms; }

  // Everything but the robot of cfg(); the caller appends sensors. The robot stands where an entity
  // "robot_0" without a model keeps its place among the others, else last.
  virtual SceneCfg scene_cfg() const = 0;
  // With the robot, and the timestep of cfg().
  SceneCfg whole_scene_cfg() const;
  // The entity of scene_cfg() that is the robot where cfg() names none; "": whatever has actuators.
  virtual std::string robot_entity() const { return "robot_0"; }
  // Patterns of the names of its actuators by move group, for such a robot; none: one group of all.
  virtual ActuatorGroups robot_groups() const { return {}; }
  // Cameras of the scene that an episode records, besides the robot's; full names.
  virtual std::vector<CameraMount> cameras() const { return {}; }
  // Keyframe from which episodes start before sample(); -1: the model's defaults.
  virtual int start_key() const { return -1; }

  // The worlds in which it is played. Called before initialize(), by those who have a simulation.
  virtual void bind(const std::shared_ptr<Simulation>& /*simulation*/) {}
  void initialize(const mjModel* model, int num_worlds);
  // From here on episodes are those of this seed.
  void reseed(std::uint64_t seed) { cfg_.seed = seed; }
  const mjModel* model() const { return model_; }
  int num_worlds() const { return num_worlds_; }
  Robot& robot() { return whole_ ? whole_->robot() : *robot_; }
  const Robot& robot() const { return whole_ ? whole_->robot() : *robot_; }

  // Throws ValueError "Policy already registered" on a second call. The policy must outlive the
  // task.
  void register_policy(Policy& policy);
  Policy* policy() const { return whole_ ? whole_->policy() : policy_; }

  // --- one episode of one world
  // Writes the start state of episode number `episode`: a function of (cfg.seed, episode) alone,
  // whatever the world. `draw` > 0: another start of it, where those before cannot be played.
  void sample(int world, std::int64_t episode, const StateRow& state, int draw = 0);
  // After forward(): what the episode is measured against (start poses), the controllers' targets.
  // Resets the step count.
  virtual void begin(const World& world);
  // Counts the step, remembers the action, sets targets and writes ctrl (noise keyed by seed,
  // episode, step).
  void apply(const World& world, const Action& action, const StateRow& state);
  virtual Evaluation evaluate(const World& world) const = 0;

  // Why the start that this fresh world shows cannot be played; "": it can. The rollout draws others
  // then, some times.
  virtual std::string start_fault(const World& /*world*/) const { return ""; }

  // --- all active worlds at once, on the caller's thread
  virtual void begin_all(ActiveWorlds& worlds);
  // The actions are applied; the worlds are about to move.
  virtual void advance() {}
  // Fills the evaluations of the active worlds; `out` has one for every world there is.
  virtual void evaluate_all(ActiveWorlds& worlds, std::span<Evaluation> out);
  // True: write_info() is made of what evaluate_all() found, and is asked after it.
  virtual bool info_follows_evaluation() const { return false; }

  std::int64_t episode(int world) const { return now(world).number; }
  int episode_step(int world) const { return now(world).step; }
  bool done_received(int world) const { return now(world).done; }
  // What goes wrong on purpose in this world's episode.
  const Perturbation& perturbation(int world) const { return now(world).perturbation; }
  // As the policy gave it, before clipping and noise; null before the first.
  const Action* last_action(int world) const {
    return now(world).step > 0 ? &now(world).action : nullptr;
  }

  // --- what observations and recordings say about it
  // The main one first. Roles are the same in every episode, and known after initialize(); bodies
  // may change.
  virtual std::span<const TaskObject> objects(int world) const = 0;
  virtual std::string description(int world) const = 0;  // "Pick up the mug"
  // Bodies with a free joint that are absent from some episodes, and whether one of them takes part in this world's.
  // An absent body is held far away.
  virtual std::vector<int> absentees() const { return {}; }
  virtual bool present(int /*world*/, int /*body*/) const { return true; }
  using Referrals = std::vector<std::pair<std::string, std::vector<Referral>>>;  // by role
  virtual Referrals referrals(int world) const = 0;
  // Pose of the object with this role: at the first observation, and where the task wants it.
  // Throws KeyError.
  virtual Pose start_pose(int world, std::string_view role) const = 0;
  virtual std::optional<Pose> goal_pose(int world, std::string_view role) const = 0;
  // Members of task_info, keys sorted; the caller opens and closes the object.
  virtual void write_info(const World& world, JsonWriter& json) const = 0;
  // obs_scene: JSON text with task_type, task_description, policy_dt_ms, referral_expressions,
  // policy_phases, the task's own keys.
  std::string obs_scene(int world) const;

  // For planners of grasps; null where nothing is to be grasped.
  virtual const GraspScene* grasp_scene() const { return nullptr; }

  // Sensors beyond the core that this task records (obj_start, grasp_state_*, obj_end). They refer
  // to this task.
  virtual std::vector<std::shared_ptr<Sensor>> create_task_sensors() const = 0;
  // The whole suite before it is bound: a task may take sensors out, or put them in another order.
  virtual void edit_suite(SensorSuite& /*suite*/) const {}

 protected:
  virtual void initialize_task() = 0;  // model() and robot() are there
  // Writes everything except the joints of cfg()'s robot, unless samples_robot() is true; returns
  // where the robot's base stands, nothing for where the model has it.
  virtual std::optional<Pose> sample_scene(int world, Rng& rng, const StateRow& state) = 0;
  virtual bool samples_robot() const { return false; }
  // In a state that another task has sampled: chooses what the episode is about, and moves nothing.
  // Throws ValueError for a task that cannot.
  virtual void choose_goal(int world, Rng& rng, const StateRow& state);
  // Further members of obs_scene with text values, in this order.
  virtual std::vector<std::pair<std::string, std::string>> scene_info(int world) const {
    (void)world;
    return {};
  }
  // terminal and truncated of an observation with this success; `over`: the episode is, for a
  // reason of the task's.
  Evaluation judge(int world, double reward, bool success, bool over = false) const;
  // The same of a success that lacks this; "": it is one.
  Evaluation judge_by(int world, double reward, std::string_view lacks) const;

 private:
  friend class MultiTask;  // of which this one may be a part
  struct Episode {
    std::int64_t number = 0;
    int step = 0;
    bool done = false;
    Action action;
    Perturbation perturbation;
  };
  const Episode& now(int world) const { return whole_ ? whole_->now(world) : episodes_[world]; }

  TaskCfg cfg_;
  const mjModel* model_ = nullptr;
  int num_worlds_ = 0;
  std::unique_ptr<Robot> robot_;
  Policy* policy_ = nullptr;
  Task* whole_ = nullptr;  // whose robot, policy and episodes are a part's
  std::vector<Episode> episodes_;
};

}  // namespace mjsense
