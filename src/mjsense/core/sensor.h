// SPDX-License-Identifier: Apache-2.0
#pragma once
// The one idea of mjsense: a named, typed, batched measurement. Given B worlds a sensor owns
// preallocated rows [B, ...] and fills row w from world w. Scene sensors, observation sensors and
// users' own are this class and have this life:
//
//   edit_spec(spec)   before compilation: add the MuJoCo elements it needs
//   initialize(init)  after compilation: resolve names to ids, declare fields; no allocation later
//   substep(world)    after each physics step, if wants_substep(): air time, history
//   compute(world)    fill row w; a pure function of (model, data, its own state, its RNG key)
//   cast(context)     stages kCast and kBatch: the work that is done for many worlds at once
//   reset(world)      forget the episode of this world; compute() follows before anybody reads

#include <mujoco/mujoco.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/spec.h"

namespace mjsense {

class DebugShapes;
class RayScene;
class Scene;
class Shared;
class ThreadPool;

// One world as a sensor sees it. In compute() and substep() the derived fields of `data` belong to
// its present state: positions and contacts, velocities, accelerations and forces, as far as the
// sensor needs() them; in reset() all of them. `model` holds the world's own values of randomised fields and is valid during the call only. MuJoCo
// errors leave a call by longjmp: hold no object with a destructor across a MuJoCo function that
// can fail.
struct World {
  int id = 0;  // row, 0 .. B-1
  const mjModel* model = nullptr;
  mjData* data = nullptr;
  std::int64_t substep =
      0;  // physics steps since this world's last reset; time = substep * model->opt.timestep
  std::int64_t tick =
      0;  // physics steps since the last seeding; never goes back at a reset: the RNG's step
  std::int64_t episode = 0;  // resets of this world since the last seeding
  std::uint64_t seed = 0;
  bool first = false;     // no step was taken since the reset
  std::uint32_t key = 0;  // whose random numbers these are: the world's id, or its episode's number
  // Changes whenever the derived fields of `data` may have: a physics step, forward, reset. What
  // was taken from them at an equal moment of the same world may be reused. 0: not known.
  std::uint64_t moment = 0;
  double elapsed = 0.0;  // s that one substep() stands for; 0: the model's timestep

  double dt() const { return elapsed > 0.0 ? elapsed : model->opt.timestep; }
  double time() const { return static_cast<double>(substep) * model->opt.timestep; }
  // Numbers for this moment: the same at any thread count and any B.
  Rng rng(std::uint32_t stream) const {
    return {seed, key, stream, static_cast<std::uint64_t>(tick)};
  }
};

// One typed buffer of a sensor and what it means. A sensor with one field names it ""; its stream
// is the sensor's own name. Another field's stream is "sensor/field".
struct Field {
  std::string name;
  SensorSpec spec;
  Array data;  // [B, *spec.shape]
};

struct SensorInit {
  const mjModel* model = nullptr;
  const Scene* scene = nullptr;  // null where a sensor is used without a scene
  int num_worlds = 1;
  int decimation = 1;  // substeps per control step
  int threads = 1;
  Shared* shared = nullptr;  // null where a sensor is used alone
};

// What cast() traces: the ray scene as compute() of the worlds `ids` left it.
struct CastContext {
  RayScene* rays;            // null for stage kBatch in a scene that casts nothing
  std::span<const int> ids;  // sorted
  ThreadPool& pool;
};

enum class Stage {
  kRow,       // compute() alone fills the row
  kCast,      // compute() prepares poses, cast() traces
  kPostCast,  // compute() reads rows of kCast sensors: runs after them
  kBatch,     // cast() alone, on the caller's thread, after all others: sensors written in Python
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
  // Further sensors that it brings into its scene's registry, after the discovered ones; asked
  // once, after edit_spec().
  virtual std::vector<std::unique_ptr<Sensor>> parts();
  virtual void initialize(const SensorInit& init) = 0;
  virtual bool wants_substep() const { return false; }
  virtual void substep(const World& world);
  virtual void compute(const World& world) = 0;
  virtual void cast(const CastContext& context);
  virtual void reset(const World& world);

  // Debug drawing. draw() adds what a human should see of the row of this world, which is current;
  // ValueError if that is never anything. debug_vis(): wherever the scene is drawn, unasked.
  virtual bool debug_vis() const { return false; }
  virtual void draw(const World& world, DebugShapes& shapes);

  virtual Stage stage() const { return Stage::kRow; }
  // The last stage of MuJoCo's computation whose results compute() and substep() read:
  // mjSTAGE_NONE the state alone, mjSTAGE_POS poses and contacts, mjSTAGE_VEL, mjSTAGE_ACC
  // accelerations and forces. A stage that nobody needs is not computed, and the last costs a
  // constraint solve a control step. Asked once, after initialize().
  virtual mjtStage needs() const { return mjSTAGE_ACC; }
  // True if compute() must run exactly once a control step, read or not (delays, rates, filters).
  virtual bool eager() const { return false; }
  // Keys of the sensors of its scene that initialize() looks at: they are initialized first.
  virtual std::vector<std::string> reads() const { return {}; }
  // Sensors whose rows compute() reads: they are computed first.
  virtual std::span<Sensor* const> inputs() const { return {}; }

  // Fields, valid after initialize(). Their addresses do not change.
  std::deque<Field>& fields() { return fields_; }
  const std::deque<Field>& fields() const { return fields_; }
  const Field& field(
      std::string_view name = "") const;  // throws KeyError naming the fields there are
  std::size_t bytes_per_world() const;

 protected:
  // Declares a field: allocates [B, *shape]. `spec.name` is filled in. Call from initialize() only.
  Field& add_field(std::string_view name, SensorSpec spec, int num_worlds);
  // A field whose rows are those of another sensor's field, which must live longer.
  Field& share_field(std::string_view name, SensorSpec spec, Field& source);
  void clear_fields() { fields_.clear(); }

 private:
  std::string name_;
  std::deque<Field> fields_;
};

// The configuration of a scene sensor; build() makes the sensor.
struct SensorCfg {
  std::string name;
  virtual ~SensorCfg() = default;
  [[nodiscard]] virtual std::unique_ptr<Sensor> build() const = 0;
  // Key in the scene's registry: "robot/imu" for a built-in sensor on an entity, else the plain
  // name.
  virtual std::string key() const { return name; }

 protected:
  SensorCfg() = default;
  SensorCfg(const SensorCfg&) = default;
  SensorCfg& operator=(const SensorCfg&) = default;
};

}  // namespace mjsense
