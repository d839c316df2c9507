// SPDX-License-Identifier: Apache-2.0
#pragma once
// One imperfection of a sensor: noise, bias, delay, dropout ... An effect changes a row in place,
// in the row's own unit; times are seconds. Random numbers depend on (seed, world, stream, tick)
// alone, so results are the same at any number of threads and worlds.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/fields.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/spec.h"

namespace mjsense {

// When a row was measured.
struct EffectMoment {
  int world = 0;          // row
  std::uint32_t key = 0;  // whose random numbers these are: usually the world
  std::uint64_t seed = 0;
  std::int64_t tick = 0;
  std::int64_t episode = 0;  // 1 is the first since the seeding
  double time = 0.0;         // s, tick as a time
  double elapsed = 0.0;  // s since the last new row of this world; 0 for the first of an episode
  bool first = false;    // first row of an episode
  // False when this tick's row is measured again (after a state write): state must not advance, but
  // the newest value must follow.
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
  double at(int i) const {  // numeric rows
    return dtype == DType::kFloat32 ? reinterpret_cast<const float*>(data)[i]
                                    : reinterpret_cast<const double*>(data)[i];
  }
  // x_i <- f(x_i, i), numeric rows
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

// What an effect is set up for.
struct EffectInit {
  std::string place;  // starts every message: "sensor 'imu', effect 0 (noise)"
  int num_worlds = 1;
  DType dtype = DType::kFloat32;
  int size = 1;              // elements of a row
  double period = 0.0;       // s between rows
  std::uint32_t stream = 0;  // its own random numbers
};

// Configuration (public members) and, in a copy made by clone(), the state of B worlds.
class Effect {
 public:
  virtual ~Effect() = default;
  [[nodiscard]] virtual std::unique_ptr<Effect> clone() const = 0;
  virtual std::string kind() const = 0;

  // Throws ValueError for what its fields say of each other, whatever row it will meet:
  // check_fields() calls it after the ranges, when a configuration is made and before initialize().
  // `place` starts the message.
  virtual void validate(std::string_view /*place*/) const {}
  // Throws ValueError for what does not suit the row; allocates. Nothing allocates afterwards.
  virtual void initialize(const EffectInit& init) = 0;
  virtual void apply(const EffectMoment& moment, const EffectRow& row) = 0;
  // A new episode of this world; apply() with first follows.
  virtual void reset(const EffectMoment& /*moment*/) {}
  // True if it must see every row, read or not.
  virtual bool eager() const { return false; }

  std::vector<std::string> fields;
};
template <class V>
void visit_fields(V& v, Effect& c) {
  v.object("Effect", "An imperfection of a sensor.");
  v("fields", c.fields, "Fields of the sensor that are affected; empty: all.");
}

// One value for all components or one for each.
using PerComponent = std::vector<double>;
inline double component(const PerComponent& values, int i) {
  return values.size() == 1 ? values[0] : values[i];
}
// No component of `low` above that of `high`.
void check_order(const PerComponent& low, const PerComponent& high, std::string_view place);
// One value, or as many as the row has.
void check_components(const PerComponent& values, const char* name, const EffectInit& init);
void check_numeric(const EffectInit& init);  // float32 or float64, else ValueError

// The laws of random numbers. Each takes one value for all components or one for each.
struct Gaussian {
  PerComponent std = {0.0}, mean = {0.0};
};
struct Uniform {
  PerComponent low = {0.0}, high = {0.0};

  void validate(std::string_view place) const;  // low <= high
};
struct Constant {
  PerComponent value = {0.0};
};

// A random number.
struct Draw {
  using Law = std::variant<Gaussian, Uniform, Constant>;
  Law law;

  static Draw gaussian(PerComponent std, PerComponent mean = {0.0});
  static Draw uniform(PerComponent low, PerComponent high);
  static Draw constant(PerComponent value);

  void check(const EffectInit& init) const;  // that it suits the row
  double sample(Rng& rng, int i) const;
};
template <>
inline constexpr const char* kChoiceName<Draw::Law> = "Draw";
template <>
inline constexpr int kPlainAlternative<Draw::Law> = 2;

template <class V>
void visit_fields(V& v, Gaussian& c) {
  v.object("Gaussian", "Normal distribution.", "gaussian").frozen().module("effects");
  v("std", c.std, "Standard deviation.").at_least(0).or_one().not_empty();
  v("mean", c.mean, "Mean.").or_one().not_empty();
}
template <class V>
void visit_fields(V& v, Uniform& c) {
  v.object("Uniform", "Uniform distribution on [low, high).", "uniform").frozen().module("effects");
  v("low", c.low, "Lower bound, included.").or_one().not_empty();
  v("high", c.high, "Upper bound, excluded.").or_one().not_empty();
}
template <class V>
void visit_fields(V& v, Constant& c) {
  v.object("Constant", "A constant value.", "constant").frozen().module("effects");
  v("value", c.value, "The value.").or_one().not_empty();
}

// How a random number e meets a value x: x + e, x e, or e alone.
enum class Operation { kAdd, kScale, kAbs };
template <>
inline constexpr std::array<std::string_view, 3> kWords<Operation>{"add", "scale", "abs"};
inline double operate(Operation operation, double x, double e) {
  return operation == Operation::kAdd ? x + e : operation == Operation::kScale ? x * e : e;
}

}  // namespace mjsense
