// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random errors: white noise, a bias per episode, and a bias that drifts.

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/effects/distribution.h"
#include "mjsense/effects/effect.h"

namespace mjsense::effects {

// x <- x + e (or x e, or e), with e drawn for every row and component.
struct Noise : Effect {
  Draw draw;
  NamedEnum<Operation> operation = Operation::kAdd;
  // unit / sqrt(Hz). Adds a Gaussian of std = density / sqrt(period), whose Allan deviation is
  // density / sqrt(tau): the "noise density" of a data sheet. It is added to `draw`.
  PerComponent density = {0.0};

  Noise() = default;
  explicit Noise(Draw draw, Operation operation = Operation::kAdd);
  static Noise with_density(PerComponent density);

  std::unique_ptr<Effect> clone() const override { return std::make_unique<Noise>(*this); }
  std::string kind() const override { return "noise"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;

 private:
  std::uint32_t stream_ = 0;
  double density_factor_ = 0.0;  // 1 / sqrt(period)
  bool has_density_ = false;
};
template <class V>
void visit_fields(V& v, Noise& c) {
  v.object("Noise", "Independent noise for every row and component.", "noise")
      .frozen()
      .module("effects");
  v("draw", c.draw.distribution,
    "Distribution: Gaussian, Uniform or Constant; a number means Constant.");
  v("operation", c.operation, "How the noise changes the value; abs: it replaces the value.");
  v("density", c.density,
    "Noise density as on a data sheet: std = density / sqrt(period) is added to draw.")
      .unit("unit/sqrt(Hz)")
      .at_least(0)
      .or_one()
      .not_empty();
  v.include(static_cast<Effect&>(c));
}

// x <- x + b, where b is constant over an episode (turn-on bias). At every reset b <- operation(b,
// e), starting from 0: kAbs draws it anew, and kAdd makes it a random walk over episodes (mjlab's
// additive-bias model with "add").
struct EpisodeBias : Effect {
  Draw draw;
  NamedEnum<Operation> operation = Operation::kAbs;
  bool per_component = true;  // false: one number for the whole row

  EpisodeBias() = default;
  explicit EpisodeBias(Draw draw, Operation operation = Operation::kAbs);

  std::unique_ptr<Effect> clone() const override { return std::make_unique<EpisodeBias>(*this); }
  std::string kind() const override { return "episode_bias"; }
  void initialize(const EffectInit& init) override;
  void reset(const EffectTime& moment) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;

 private:
  std::uint32_t stream_ = 0;
  int size_ = 0;
  std::vector<double> bias_;         // [B, size]
  std::vector<std::uint8_t> drawn_;  // [B]
};
template <class V>
void visit_fields(V& v, EpisodeBias& c) {
  v.object("EpisodeBias", "A bias that is constant within an episode (turn-on bias).",
           "episode_bias")
      .frozen()
      .module("effects");
  v("draw", c.draw.distribution,
    "Distribution: Gaussian, Uniform or Constant; a number means Constant.");
  v("operation", c.operation,
    "What happens at a reset. abs: the bias is drawn anew; add: the draw is added to the previous "
    "bias.");
  v("per_component", c.per_component,
    "Draw each component separately. False: one number for the whole row.");
  v.include(static_cast<Effect&>(c));
}

// x <- x + b with db = -b / tau dt + sigma sqrt(2 / tau) dW: a first-order Gauss-Markov process
// with standard deviation sigma and autocorrelation exp(-|t| / tau). It starts from its stationary
// distribution at every reset. If tau is infinite, it is a random walk db = density dW from 0.
struct BiasDrift : Effect {
  PerComponent std = {0.0};  // unit
  double time_constant_s = std::numeric_limits<double>::infinity();
  PerComponent density = {0.0};  // unit / sqrt(s), of the random walk
  bool start_at_zero = false;

  std::unique_ptr<Effect> clone() const override { return std::make_unique<BiasDrift>(*this); }
  std::string kind() const override { return "bias_drift"; }
  void validate(std::string_view context) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
  bool needs_every_step() const override { return true; }

 private:
  std::uint32_t stream_ = 0;
  int size_ = 0;
  std::vector<double> bias_;  // [B, size]
};
template <class V>
void visit_fields(V& v, BiasDrift& c) {
  v.object("BiasDrift",
           "First-order Gauss-Markov bias; with an infinite time constant a random walk.",
           "bias_drift")
      .frozen()
      .module("effects");
  v("std", c.std, "Standard deviation of the stationary process.").at_least(0).or_one().not_empty();
  v("time_constant_s", c.time_constant_s, "Correlation time.").positive().may_be_infinite();
  v("density", c.density, "Density of the random walk.")
      .unit("unit/sqrt(s)")
      .at_least(0)
      .or_one()
      .not_empty();
  v("start_at_zero", c.start_at_zero,
    "Start an episode without bias instead of with a random one.");
  v.include(static_cast<Effect&>(c));
}

}  // namespace mjsense::effects
