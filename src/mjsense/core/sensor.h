// SPDX-License-Identifier: Apache-2.0
#pragma once
// The central concept of mjsense: a named, typed, batched measurement. For B worlds a sensor owns
// preallocated rows [B, ...] and fills row w from world w. Scene sensors, observation sensors and
// user-defined sensors derive from this class. Its calls, in the order of a sensor's life:
//
//   Once, while the scene is made
//     edit_spec(spec)    before compilation: add the MuJoCo elements that the sensor needs
//     initialize(init)   after compilation: resolve names to ids and declare the fields; nothing
//                        is allocated later
//     needs()            the last MuJoCo stage that the sensor reads
//
//   In each control step
//     substep(world)     after each physics step, if wants_substep(): update state that must see
//                        every step, such as air time
//     compute(world)     when the row is read, or in every step if needs_every_step(): fill row w
//                        from the model, the data, the sensor's own state and its random key only
//     cast(context)      stages kCast and kBatch: rays and images of many worlds at once
//
//   When an episode begins in a world
//     reset(world)       clear the sensor's state; the row is computed again before it is read
//
// Calls with a World may run on several threads at once, for different worlds.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor_spec.h"

namespace mjsense::rays {
class RayScene;
}  // namespace mjsense::rays

namespace mjsense::scene {
class Scene;
}  // namespace mjsense::scene

namespace mjsense::worlds {
class Worlds;
}  // namespace mjsense::worlds

namespace mjsense {

class DebugShapes;
class SharedCache;
class ThreadPool;

// One world as passed to a sensor. In compute() and substep() the derived fields of `data`
// (positions and contacts, velocities, accelerations and forces) are up to date as far as the
// sensor's needs() requires; in reset() all of them are. `model` holds the world's own values of
// randomised fields and is valid during the call only. MuJoCo errors leave a call by longjmp, so do
// not hold an object with a destructor across a MuJoCo function that can fail.
struct World {
  int id = 0;  // row, 0 .. B-1
  const mjModel* model = nullptr;
  mjData* data = nullptr;
  // Physics steps since this world's last reset; time = substep * model->opt.timestep.
  std::int64_t substep = 0;
  // Physics steps since the last seeding, which an episode does not reset; the step of the RNG.
  std::int64_t tick = 0;
  std::int64_t episode = 0;  // resets of this world since the last seeding
  std::uint64_t seed = 0;
  bool first = false;     // no step since the reset
  std::uint32_t key = 0;  // RNG key of the world: its id, or the number of its episode
  // Changes whenever the derived fields of `data` may have changed: at a physics step, forward or
  // reset. Results computed from them may be reused while the world's `moment` is equal. 0:
  // unknown.
  std::uint64_t moment = 0;
  double elapsed = 0.0;  // s, duration that one substep() represents; 0: the model's timestep

  double dt() const { return elapsed > 0.0 ? elapsed : model->opt.timestep; }
  double time() const { return static_cast<double>(substep) * model->opt.timestep; }
  // Random numbers for the current step; independent of the number of threads and of B.
  Rng rng(std::uint32_t stream) const {
    return {seed, key, stream, static_cast<std::uint64_t>(tick)};
  }
};

// One typed buffer of a sensor and its description. A sensor with a single field names it "", and
// the stream has the sensor's name. The stream of any other field is "sensor/field".
struct Field {
  std::string name;
  SensorSpec spec;
  Array data;  // [B, *spec.shape]
};

struct SensorInit {
  const mjModel* model = nullptr;
  const scene::Scene* scene = nullptr;  // null if the sensor is used without a scene
  int num_worlds = 1;
  int decimation = 1;  // substeps per control step
  int threads = 1;
  SharedCache* shared = nullptr;  // null if the sensor is used outside of a simulation
};

// Input of cast(): the ray scene after compute() of the worlds `ids`.
struct CastContext {
  rays::RayScene* rays;      // null for stage kBatch in a scene without ray casting
  std::span<const int> ids;  // sorted
  ThreadPool& pool;
  const worlds::Worlds* worlds = nullptr;  // null if the sensor is used outside of a simulation
};

enum class Stage {
  kRow,       // compute() alone fills the row
  kCast,      // compute() prepares poses, cast() traces
  kPostCast,  // compute() reads rows of kCast sensors, so it runs after them
  kBatch,  // only cast() is called, after all others and on the caller's thread: Python's sensors
};

class Sensor {
 public:
  explicit Sensor(std::string name) : name_(std::move(name)) {}
  virtual ~Sensor() = default;
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;

  const std::string& name() const { return name_; }  // key in its scene or suite
  virtual std::string_view kind() const = 0;         // "builtin", "contact", "camera", ...

  virtual void edit_spec(mjSpec* spec);
  // Further sensors that this one adds to its scene's registry, after the discovered ones. Called
  // once, after edit_spec().
  virtual std::vector<std::unique_ptr<Sensor>> parts();
  virtual void initialize(const SensorInit& init) = 0;
  virtual bool wants_substep() const { return false; }
  virtual void substep(const World& world);
  virtual void compute(const World& world) = 0;
  virtual void cast(const CastContext& context);
  virtual void reset(const World& world);

  // Debug visualisation. draw() adds shapes for the current row of this world; it throws ValueError
  // if the sensor has nothing to draw. If debug_vis() is true, the shapes are drawn wherever the
  // scene is.
  virtual bool debug_vis() const { return false; }
  virtual void draw(const World& world, DebugShapes& shapes);

  virtual Stage stage() const { return Stage::kRow; }
  // The last stage of MuJoCo's pipeline whose results compute() and substep() read: mjSTAGE_NONE
  // the state only, mjSTAGE_POS poses and contacts, mjSTAGE_VEL velocities, mjSTAGE_ACC
  // accelerations and forces. Stages that no sensor needs are skipped; the last one costs a
  // constraint solve per control step. Called once, after initialize().
  virtual mjtStage needs() const { return mjSTAGE_ACC; }
  // True if compute() must run exactly once per control step even if the sensor is not read
  // (delays, rates, filters).
  virtual bool needs_every_step() const { return false; }
  // Keys of the scene's sensors that initialize() accesses; they are initialized first.
  virtual std::vector<std::string> initialization_dependencies() const { return {}; }
  // Sensors whose rows compute() reads; they are computed first.
  virtual std::span<Sensor* const> inputs() const { return {}; }

  // Fields, valid after initialize(). Their addresses are stable.
  std::deque<Field>& fields() { return fields_; }
  const std::deque<Field>& fields() const { return fields_; }
  // Throws KeyError with the names of the fields.
  const Field& field(std::string_view name = "") const;
  std::size_t bytes_per_world() const;

 protected:
  // Declares a field and allocates [B, *shape]. Sets `spec.name`. Call it from initialize() only.
  Field& add_field(std::string_view name, SensorSpec spec, int num_worlds);
  // Declares a field that shares the rows of another sensor's field, which must outlive it.
  Field& share_field(std::string_view name, SensorSpec spec, Field& source);
  void clear_fields() { fields_.clear(); }

 private:
  std::string name_;
  std::deque<Field> fields_;
};

// Configuration of a scene sensor; build() creates the sensor.
struct SensorCfg {
  std::string name;
  virtual ~SensorCfg() = default;
  [[nodiscard]] virtual std::unique_ptr<Sensor> build() const = 0;
  // Key in the scene's registry: "robot/imu" for a built-in sensor of an entity, otherwise the
  // name.
  virtual std::string key() const { return name; }

 protected:
  SensorCfg() = default;
  SensorCfg(const SensorCfg&) = default;
  SensorCfg& operator=(const SensorCfg&) = default;
};
template <class V>
void visit_fields(V& v, SensorCfg& c) {
  v.object("SensorCfg", "Base of the built-in sensor configurations.");
  v("name", c.name, "Name of the sensor in the scene: ``scene[name]``.").required();
}

}  // namespace mjsense
