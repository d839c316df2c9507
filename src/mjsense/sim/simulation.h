#pragma once
// Scene + worlds + sensors: steps physics and keeps every measurement fresh.
//
// A sensor is computed when it is read and stale, and from then on in the same parallel pass as the physics, for as long as it
// is read every step. Stale means: the world was stepped, reset, forwarded or written since.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/parallel.h"
#include "mjsense/core/sensor.h"
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
  Simulation(std::shared_ptr<Scene> scene, const SimulationCfg& cfg);
  ~Simulation();

  Scene& scene() { return *scene_; }
  Worlds& worlds() { return *worlds_; }
  ThreadPool& pool() { return *pool_; }
  const mjModel* model() const { return scene_->model(); }
  int num_worlds() const { return cfg_.num_worlds; }
  int decimation() const { return cfg_.decimation; }
  double step_dt() const;  // s, one control step

  void step(int control_steps = 1);
  void reset(std::span<const int> ids = {}, int key = -1);
  void seed(std::uint64_t seed);
  void forward(std::span<const int> ids = {});

  // Peer-compatible low level (mjlab's order of calls): raw mj_step, and sensors' per-substep state advanced by hand.
  void step_raw(int substeps);
  void update_sensors(double dt);

  // Adds a sensor that is not part of the scene (observation sensors, users' own); initializes it at once.
  void add(std::shared_ptr<Sensor> sensor);
  // Makes the sensor's rows current in every world, then they may be read until the next change.
  void refresh(Sensor& sensor);
  void refresh(std::span<Sensor* const> sensors);
  void invalidate(std::span<const int> ids = {});

  const std::vector<Failure>& failures() const { return worlds_->failures(); }
  RayScene& rays();

 private:
  struct Hooks;
  struct Slot;
  SimulationCfg cfg_;
  std::shared_ptr<Scene> scene_;
  std::unique_ptr<Worlds> worlds_;
  std::unique_ptr<ThreadPool> pool_;
  std::unique_ptr<RayScene> rays_;
  std::vector<std::shared_ptr<Sensor>> added_;
  std::vector<std::unique_ptr<Slot>> slots_;
};

}  // namespace mjsense
