// SPDX-License-Identifier: Apache-2.0
#pragma once
// A simulation of several worlds of a scene: steps the physics and keeps measurements up to date.
//
// A sensor is computed when it is read and its rows are stale, that is, after the world was
// stepped, reset or forwarded. As long as it is read every step, it is computed in the same
// parallel pass as the physics.

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/core/sensor.h"
#include "mjsense/core/shared_cache.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/scene/scene.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::sim {

struct SimulationCfg {
  int num_worlds = 1;
  int decimation = 1;  // substeps per control step
  int threads = 0;     // 0: one per CPU that this process may use
  std::uint64_t seed = 0;
};

class Simulation {
 public:
  // All worlds start reset, at the model's defaults. Throws RuntimeError if another simulation uses
  // this scene.
  Simulation(std::shared_ptr<scene::Scene> scene, const SimulationCfg& cfg);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  scene::Scene& scene() { return *scene_; }
  const std::shared_ptr<scene::Scene>& scene_ptr() const { return scene_; }
  worlds::Worlds& worlds() { return *worlds_; }
  ThreadPool& pool() { return *pool_; }
  // The model that is simulated; it has none of the values that differ between worlds.
  const mjModel* model() const { return worlds_->model(); }
  // The model of one world: see Worlds::model_of().
  mjModel model_of(int world) const { return worlds_->model_of(world); }
  int num_worlds() const { return cfg_.num_worlds; }
  int decimation() const { return cfg_.decimation; }
  // s, duration of a control step
  double step_dt() const { return cfg_.decimation * model()->opt.timestep; }

  // Calls `control` before every `every`-th physics step of step(), in the parallel pass; see
  // WorldHooks::control() for what it may do. An empty function removes it.
  using Control = std::function<mjtStage(const World& world, int index)>;
  void set_control(int every, Control control);

  // Steps the worlds `ids`; all others keep their state.
  void step(int control_steps = 1, worlds::WorldIds ids = worlds::all_worlds);
  // The caller has stepped these worlds itself, `substeps` times each, and has written the resulting
  // states. Equivalent to step(), without the physics.
  void follow(int substeps, worlds::WorldIds ids = worlds::all_worlds);
  // Resets to keyframe `key`; -1: the model's defaults; Worlds::kWrittenState: the state as written.
  void reset(worlds::WorldIds ids = worlds::all_worlds, int key = -1);
  // Restarts the random numbers from this seed. Usually followed by reset().
  void seed(std::uint64_t seed) { worlds_->seed(seed); }
  // Computes derived fields and sensors after the state was written.
  void forward(worlds::WorldIds ids = worlds::all_worlds);

  // mjlab's order of calls: plain mj_step, then one update of the sensors' per-substep state.
  void step_raw(int substeps);
  // dt: s, duration that this update represents; 0: the timestep
  void update_sensors(double dt = 0.0);
  // Resets the sensors of these worlds without changing the physics.
  void reset_sensors(worlds::WorldIds ids = worlds::all_worlds);

  // Adds and initializes a sensor that is not part of the scene (observation sensors, user-defined
  // sensors).
  void add(std::shared_ptr<Sensor> sensor);
  // Makes the sensor's rows in the worlds `ids` current. They stay current until the next step,
  // reset or forward.
  void refresh(Sensor& sensor) {
    Sensor* one[] = {&sensor};
    refresh(one);
  }
  void refresh(std::span<Sensor* const> sensors, worlds::WorldIds ids = worlds::all_worlds);
  // Debug visualisation of these sensors in the current state of one world; empty: all sensors with
  // debug_vis. Drawing does not count as reading.
  [[nodiscard]] DebugShapes draw(int world, std::span<Sensor* const> sensors = {});
  // Marks all rows of these worlds as stale after the caller changed the state.
  void invalidate(worlds::WorldIds ids = worlds::all_worlds);

  // Time spent on a sensor since measure_cost(true).
  struct Cost {
    double compute = 0;  // s of CPU time, all worlds together
    double cast = 0;     // s of wall time
  };
  void measure_cost(bool on) { measure_cost_ = on; }
  Cost cost(const Sensor& sensor) const;
  // s of CPU time spent on updating the ray scene to the worlds' poses.
  double ray_scene_cost() const;

  // Worlds that failed in the last step, reset or forward. Only these worlds were reset.
  const std::vector<worlds::Failure>& failures() const { return worlds_->failures(); }
  rays::RayScene& rays();  // created on first use

 private:
  struct Slot;
  class Hooks;
  class DrawHooks;
  enum class Change { kStep, kFollow, kForward, kReset, kNone };

  void initialize_scene();
  void initialize(Sensor& sensor);
  Slot& slot_of(const Sensor& sensor) const;
  // Performs `change` and makes `slots` (each after its inputs) current in the worlds `ids`. Here
  // and below, `ids` are validated and sorted. `argument`: the keyframe of kReset, the substeps of
  // kStep and kFollow.
  void compute(std::span<Slot* const> slots, std::span<const int> ids, Change change,
               int argument = 0);
  void advance(worlds::WorldIds ids, Change change, int substeps, bool last);
  void cast(std::span<Slot* const> slots, std::span<const int> ids, int phase);
  void make_current(std::span<Sensor* const> sensors, worlds::WorldIds ids);
  template <class Wanted>
  void collect(std::vector<Slot*>& slots, Wanted&& wanted);
  void mark_stale(std::span<const int> ids);

  // Buffers that are reused, so that a step allocates nothing. There is one set per level of nested
  // calls, because a sensor written in Python may read other sensors while it is computed.
  struct Scratch;
  class Borrowed;
  std::vector<std::unique_ptr<Scratch>> scratch_;

  SimulationCfg cfg_;
  SharedCache shared_;
  std::shared_ptr<scene::Scene> scene_;
  std::shared_ptr<void> claim_;  // reserves the scene
  std::unique_ptr<worlds::Worlds> worlds_;
  std::unique_ptr<ThreadPool> pool_;
  std::unique_ptr<rays::RayScene> rays_;
  std::vector<std::shared_ptr<Sensor>> added_;
  std::vector<std::unique_ptr<Slot>> slots_;  // scene sensors, then added sensors
  std::vector<std::int64_t> version_;         // of each world's state
  std::vector<std::int64_t> rays_version_;    // version_ of the poses in the ray scene
  std::vector<double> rays_s_;                // s spent on updating the ray scene, by world
  bool any_substep_ = false;
  // maximum stage needed by the sensors with wants_substep()
  mjtStage substep_stage_ = mjSTAGE_NONE;
  bool measure_cost_ = false;
  int control_every_ = 0;
  Control control_;
};

}  // namespace mjsense::sim
