// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/distribution.h"

#include <utility>

namespace mjsense::effects {

Draw Draw::gaussian(PerComponent std, PerComponent mean) {
  return {Gaussian{std::move(std), std::move(mean)}};
}

Draw Draw::uniform(PerComponent low, PerComponent high) {
  return {Uniform{std::move(low), std::move(high)}};
}

Draw Draw::constant(PerComponent value) { return {Constant{std::move(value)}}; }

void Uniform::validate(std::string_view context) const { check_order(low, high, context); }

void Draw::check(const EffectInit& init) const {
  if (const auto* g = std::get_if<Gaussian>(&distribution)) {
    check_components(g->mean, "mean", init);
    check_components(g->std, "std", init);
  } else if (const auto* u = std::get_if<Uniform>(&distribution)) {
    check_components(u->low, "low", init);
    check_components(u->high, "high", init);
  } else {
    check_components(std::get<Constant>(distribution).value, "value", init);
  }
}

double Draw::sample(Rng& rng, int i) const {
  if (const auto* g = std::get_if<Gaussian>(&distribution)) {
    return component(g->mean, i) + component(g->std, i) * rng.normal();
  }
  if (const auto* u = std::get_if<Uniform>(&distribution)) {
    return rng.uniform(component(u->low, i), component(u->high, i));
  }
  return component(std::get<Constant>(distribution).value, i);
}

}  // namespace mjsense::effects
