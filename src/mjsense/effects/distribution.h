// SPDX-License-Identifier: Apache-2.0
#pragma once
// The random numbers of effects: their distributions, and how they change a value.

#include <array>
#include <string_view>
#include <variant>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/effects/effect.h"

namespace mjsense::effects {

// Distributions. Each parameter is one value for all components, or one for each.
struct Gaussian {
  PerComponent std = {0.0}, mean = {0.0};
};
struct Uniform {
  PerComponent low = {0.0}, high = {0.0};

  void validate(std::string_view context) const;  // throws unless low <= high
};
struct Constant {
  PerComponent value = {0.0};
};

// A random number with a given distribution.
struct Draw {
  using Distribution = std::variant<Gaussian, Uniform, Constant>;
  Distribution distribution;

  static Draw gaussian(PerComponent std, PerComponent mean = {0.0});
  static Draw uniform(PerComponent low, PerComponent high);
  static Draw constant(PerComponent value);

  void check(const EffectInit& init) const;  // throws if it does not suit the row
  double sample(Rng& rng, int i) const;
};

}  // namespace mjsense::effects

namespace mjsense {
template <>
inline constexpr const char* kChoiceName<effects::Draw::Distribution> = "Draw";
template <>
inline constexpr int kPlainAlternative<effects::Draw::Distribution> = 2;
}  // namespace mjsense

namespace mjsense::effects {

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

// How a random number e changes a value x: x + e, x e, or e instead of x.
enum class Operation { kAdd, kScale, kAbs };
constexpr std::array<std::string_view, 3> enum_names(Operation) { return {"add", "scale", "abs"}; }

inline double operate(Operation operation, double x, double e) {
  return operation == Operation::kAdd ? x + e : operation == Operation::kScale ? x * e : e;
}

}  // namespace mjsense::effects
