// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base class of effects. An effect is an imperfection of a sensor, such as noise, bias, delay or
// dropout. It changes a row in place, in the row's own unit; times are in seconds. Random numbers
// depend only on (seed, world, stream, tick), so that results are the same for any number of
// threads and worlds.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/fields/field_traits.h"
#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor_spec.h"

namespace mjsense::effects {

// The time at which a row is measured.
struct EffectTime {
  int world = 0;          // index of the row
  std::uint32_t key = 0;  // key of the random numbers, usually the world
  std::uint64_t seed = 0;
  std::int64_t tick = 0;
  std::int64_t episode = 0;  // 1 is the first one after seeding
  double time = 0.0;         // s, time of the tick
  double elapsed = 0.0;  // s since the previous row of this world; 0 for the first of an episode
  bool first = false;    // true for the first row of an episode
  // False if this tick's row is measured again (after a state write). The state of the effect must
  // not advance then, but the newest value must be replaced.
  bool advance = true;

  Rng rng(std::uint32_t stream) const {
    return {seed, key, stream, static_cast<std::uint64_t>(tick)};
  }
  Rng episode_rng(std::uint32_t stream) const {
    return {seed, key, stream, static_cast<std::uint64_t>(episode)};
  }
};

// A row of any element type. Numeric effects need float32 or float64.
struct EffectRow {
  std::byte* data;
  DType dtype;
  int size;

  std::size_t bytes() const { return size * dtype_size(dtype); }
  double at(int i) const {  // numeric rows only
    return dtype == DType::kFloat32 ? reinterpret_cast<const float*>(data)[i]
                                    : reinterpret_cast<const double*>(data)[i];
  }
  // x_i <- f(x_i, i), numeric rows only
  template <class F>
  void transform(F&& f) const {
    if (dtype == DType::kFloat32) {
      auto* x = reinterpret_cast<float*>(data);
      for (int i = 0; i < size; ++i) x[i] = static_cast<float>(f(static_cast<double>(x[i]), i));
    } else {
      auto* x = reinterpret_cast<double*>(data);
      for (int i = 0; i < size; ++i) x[i] = f(x[i], i);
    }
  }
};

// Properties of the rows that an effect is applied to.
struct EffectInit {
  std::string context;  // starts every message: "sensor 'imu', effect 0 (noise)"
  int num_worlds = 1;
  DType dtype = DType::kFloat32;
  int size = 1;              // number of elements of a row
  double period = 0.0;       // s between rows
  std::uint32_t stream = 0;  // stream of the effect's random numbers
};

// An effect: its configuration (public members) and, in a copy made by clone(), its state in B
// worlds.
class Effect {
 public:
  virtual ~Effect() = default;
  [[nodiscard]] virtual std::unique_ptr<Effect> clone() const = 0;
  virtual std::string kind() const = 0;

  // Throws ValueError if the fields contradict each other, whatever the row. check_fields() calls
  // it after checking ranges, when a configuration is built and before initialize(). `context`
  // starts the message.
  virtual void validate(std::string_view /*place*/) const {}
  // Throws ValueError if the effect does not suit the row. Allocates memory; other functions do
  // not.
  virtual void initialize(const EffectInit& init) = 0;
  virtual void apply(const EffectTime& moment, const EffectRow& row) = 0;
  // Starts an episode of this world; a call of apply() with moment.first follows.
  virtual void reset(const EffectTime& /*moment*/) {}
  // True if the effect must process every row, even if it is not read.
  virtual bool needs_every_step() const { return false; }

  std::vector<std::string> fields;
};
template <class V>
void visit_fields(V& v, Effect& c) {
  v.object("Effect", "An imperfection of a sensor.");
  v("fields", c.fields, "Fields of the sensor that are affected; empty: all.");
}

// One value for all components, or one for each.
using PerComponent = std::vector<double>;
inline double component(const PerComponent& values, int i) {
  return values.size() == 1 ? values[0] : values[i];
}
// Throws ValueError if a component of `low` is above that of `high`, or if their sizes differ.
void check_order(const PerComponent& low, const PerComponent& high, std::string_view context);
// Throws ValueError unless there is one value, or as many as the row has.
void check_components(const PerComponent& values, const char* name, const EffectInit& init);
void check_numeric(const EffectInit& init);  // throws ValueError unless float32 or float64

}  // namespace mjsense::effects
