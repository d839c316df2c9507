// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/core/config_checks.h"
#include "mjsense/core/error.h"

namespace mjsense {

void check_order(const PerComponent& low, const PerComponent& high, std::string_view context) {
  const std::size_t n = std::max(low.size(), high.size());
  if (std::min(low.size(), high.size()) > 1 && low.size() != high.size()) {
    throw ValueError(
        fmt::format("{}: low has {} values, but high has {}", context, low.size(), high.size()));
  }
  for (int i = 0; i < static_cast<int>(n); ++i) {
    if (component(low, i) > component(high, i)) {
      throw ValueError(fmt::format("{}: low {} is above high {}", context, component(low, i),
                                   component(high, i)));
    }
  }
}

void check_components(const PerComponent& values, const char* name, const EffectInit& init) {
  if (values.size() != 1 && static_cast<int>(values.size()) != init.size) {
    throw ValueError(fmt::format("{}: {} has {} values: must be 1, or {} like the row",
                                 init.context, name, values.size(), init.size));
  }
}

void check_numeric(const EffectInit& init) {
  if (init.dtype == DType::kFloat32 || init.dtype == DType::kFloat64) return;
  throw ValueError(fmt::format("{}: needs float32 or float64 values; the row has {}", init.context,
                               dtype_name(init.dtype)));
}

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

}  // namespace mjsense
