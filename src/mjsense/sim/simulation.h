// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scene + worlds + sensors: steps physics and keeps every measurement fresh.
//
// A sensor is computed when it is read and stale, and from then on in the same parallel pass as the
// physics, for as long as it is read every step. Stale means: the world was stepped, reset or
// forwarded since.

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/core/parallel.h"
#include "mjsense/core/sensor.h"
#include "mjsense/core/shared.h"
#include "mjsense/scene/scene.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense {

struct SimulationCfg {
  int num_worlds = 1;
  int decimation = 1;  // substeps per control step
  int threads = 0;     // 0: the CPUs this process may use
  std::uint64_t seed = 0;
};

class Simulation {
 public:
  // Every world starts reset, at the model's defaults. Throws RuntimeError if another simulation has
  // this scene.
  Simulation(std::shared_ptr<Scene> scene, const SimulationCfg& cfg);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  Scene& scene() { return *scene_; }
  const std::shared_ptr<Scene>& scene_ptr() const { return scene_; }
  Worlds& worlds() { return *worlds_; }
  ThreadPool& pool() { return *pool_; }
  // The model that is simulated; it has none of the values that differ between worlds.
  const mjModel* model() const { return worlds_->model(); }
  // The model of one world: see Worlds::model_of().
  mjModel model_of(int world) const { return worlds_->model_of(world); }
  int num_worlds() const { return cfg_.num_worlds; }
  int decimation() const { return cfg_.decimation; }
  double step_dt() const { return cfg_.decimation * model()->opt.timestep; }  // s, one control step

  // From here on `control` is called before every `every`-th physics step of a step(), in the
  // parallel pass: WorldHooks::control() says what it may do. An empty one: never again.
  using Control = std::function<mjtStage(const World& world, int index)>;
  void set_control(int every, Control control);

  // Worlds that are not among the ids stand still.
  void step(int control_steps = 1, WorldIds ids = all_worlds);
  // key: keyframe, -1 the model's defaults.
  void reset(WorldIds ids = all_worlds, int key = -1);
  // Random numbers start again from this seed; reset() usually follows.
  void seed(std::uint64_t seed) { worlds_->seed(seed); }
  // Makes derived fields and sensors current after state rows were written.
  void forward(WorldIds ids = all_worlds);

  // mjlab's order of calls, by hand: plain mj_step, then one update of the sensors' per-substep
  // state.
  void step_raw(int substeps);
  void update_sensors(double dt = 0.0);  // dt: s that this update stands for; 0: the timestep
  // Forgets the episode in the sensors of these worlds, physics untouched.
  void reset_sensors(WorldIds ids = all_worlds);

  // Adds a sensor that is not part of the scene (observation sensors, users' own) and initializes
  // it.
  void add(std::shared_ptr<Sensor> sensor);
  // Makes the sensor's rows current, in the worlds `ids`. They stay so until the next step, reset or
  // forward.
  void refresh(Sensor& sensor) {
    Sensor* one[] = {&sensor};
    refresh(one);
  }
  void refresh(std::span<Sensor* const> sensors, WorldIds ids = all_worlds);
  // What these sensors show of one world as it is now, to be seen by a human; empty: those with
  // debug_vis. Drawing does not count as reading.
  [[nodiscard]] DebugShapes draw(int world, std::span<Sensor* const> sensors = {});
  // State was changed in a way that only the caller knows.
  void invalidate(WorldIds ids = all_worlds);

  // Time that a sensor has taken since measure_cost(true).
  struct Cost {
    double compute = 0;  // s of processor time, all worlds together
    double cast = 0;     // s of wall time
  };
  void measure_cost(bool on) { measure_cost_ = on; }
  Cost cost(const Sensor& sensor) const;
  // s of processor time spent so far on moving the ray scene to the worlds' poses.
  double ray_scene_cost() const;

  // Worlds that failed in the last step, reset or forward; they were reset alone.
  const std::vector<Failure>& failures() const { return worlds_->failures(); }
  RayScene& rays();  // made when first needed

 private:
  struct Slot;
  class Hooks;
  class DrawHooks;
  enum class Change { kStep, kForward, kReset, kNone };

  void initialize_scene();
  void initialize(Sensor& sensor);
  Slot& slot_of(const Sensor& sensor) const;
  // Makes `change` happen and `slots` (each after its inputs) current in the worlds `ids`; here and
  // below: checked, in order.
  void compute(std::span<Slot* const> slots, std::span<const int> ids, Change change, int key = -1);
  void cast(std::span<Slot* const> slots, std::span<const int> ids, int phase);
  void make_current(std::span<Sensor* const> sensors, WorldIds ids);
  template <class Wanted>
  void collect(std::vector<Slot*>& slots, Wanted&& wanted);
  void mark_stale(std::span<const int> ids);

  // Buffers that keep their capacity, so that a step allocates nothing; one for each level of
  // nested calls (a sensor in Python may read other sensors while it is computed).
  struct Scratch;
  class Borrowed;
  std::vector<std::unique_ptr<Scratch>> scratch_;

  SimulationCfg cfg_;
  Shared shared_;
  std::shared_ptr<Scene> scene_;
  std::shared_ptr<void> claim_;  // on the scene
  std::unique_ptr<Worlds> worlds_;
  std::unique_ptr<ThreadPool> pool_;
  std::unique_ptr<RayScene> rays_;
  std::vector<std::shared_ptr<Sensor>> added_;
  std::vector<std::unique_ptr<Slot>> slots_;  // scene sensors, then added ones
  std::vector<std::int64_t> version_;         // of each world's state
  std::vector<std::int64_t> rays_version_;    // of the poses in the ray scene
  std::vector<double> rays_s_;                // time spent on them, by world
  bool any_substep_ = false;
  mjtStage substep_stage_ = mjSTAGE_NONE;  // that the sensors need which want every substep
  bool measure_cost_ = false;
  int control_every_ = 0;
  Control control_;
};

}  // namespace mjsense
