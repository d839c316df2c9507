// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/core/error.h"

namespace mjsense::effects {

Noise::Noise(Draw d, Operation op) : draw(std::move(d)), operation(op) {}

Noise Noise::with_density(PerComponent density) {
  Noise n;
  n.density = std::move(density);
  return n;
}

void Noise::initialize(const EffectInit& init) {
  check_numeric(init);
  draw.check(init);
  check_components(density, "density", init);
  has_density_ = std::ranges::any_of(density, [](double d) { return d > 0; });
  if (has_density_ && !(init.period > 0)) {
    throw ValueError(fmt::format("{}: a density needs a period > 0", init.context));
  }
  density_factor_ = has_density_ ? 1.0 / std::sqrt(init.period) : 0.0;
  stream_ = init.stream;
}

void Noise::apply(const EffectTime& moment, const EffectRow& row) {
  Rng rng = moment.rng(stream_);
  row.transform([&](double x, int i) {
    x = operate(operation, x, draw.sample(rng, i));
    if (has_density_) x += component(density, i) * density_factor_ * rng.normal();
    return x;
  });
}

EpisodeBias::EpisodeBias(Draw d, Operation op) : draw(std::move(d)), operation(op) {}

void EpisodeBias::initialize(const EffectInit& init) {
  check_numeric(init);
  draw.check(init);
  stream_ = init.stream;
  size_ = init.size;
  bias_.assign(static_cast<std::size_t>(init.num_worlds) * init.size, 0.0);
  drawn_.assign(init.num_worlds, 0);
}

void EpisodeBias::reset(const EffectTime& moment) {
  Rng rng = moment.episode_rng(stream_);
  double* bias = bias_.data() + static_cast<std::size_t>(moment.world) * size_;
  double e = 0.0;
  for (int i = 0; i < size_; ++i) {
    if (per_component || i == 0) e = draw.sample(rng, i);
    bias[i] = operate(operation, moment.episode > 1 ? bias[i] : 0.0, e);
  }
  drawn_[moment.world] = 1;
}

void EpisodeBias::apply(const EffectTime& moment, const EffectRow& row) {
  if (!drawn_[moment.world]) reset(moment);
  const double* bias = bias_.data() + static_cast<std::size_t>(moment.world) * size_;
  row.transform([&](double x, int i) { return x + bias[i]; });
}

void BiasDrift::validate(std::string_view context) const {
  if (std::isinf(time_constant_s) && std::ranges::any_of(std, [](double s) { return s > 0; })) {
    throw ValueError(fmt::format(
        "{}: std needs a finite time_constant_s; a random walk is set by density", context));
  }
}

void BiasDrift::initialize(const EffectInit& init) {
  check_numeric(init);
  check_components(std, "std", init);
  check_components(density, "density", init);
  stream_ = init.stream;
  size_ = init.size;
  bias_.assign(static_cast<std::size_t>(init.num_worlds) * init.size, 0.0);
}

void BiasDrift::apply(const EffectTime& moment, const EffectRow& row) {
  double* bias = bias_.data() + static_cast<std::size_t>(moment.world) * size_;
  if (moment.first && moment.advance) {
    Rng rng = moment.episode_rng(stream_ ^ 0x5bd1e995u);  // another stream than that of ticks
    for (int i = 0; i < size_; ++i) {
      bias[i] = start_at_zero ? 0.0 : component(std, i) * rng.normal();
    }
  } else if (moment.advance) {
    Rng rng = moment.rng(stream_);
    const double keep = std::exp(-moment.elapsed / time_constant_s);
    const double fresh = std::sqrt(1.0 - keep * keep), walk = std::sqrt(moment.elapsed);
    for (int i = 0; i < size_; ++i) {
      bias[i] = keep * bias[i] +
                (component(std, i) * fresh + component(density, i) * walk) * rng.normal();
    }
  }
  row.transform([&](double x, int i) { return x + bias[i]; });
}

}  // namespace mjsense::effects
