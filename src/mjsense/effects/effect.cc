#include "mjsense/effects/effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/core/checks.h"
#include "mjsense/core/error.h"

namespace mjsense {

void check_values(const PerComponent& values, std::string_view place, std::string_view name) {
  if (values.empty()) throw ValueError(fmt::format("{}: {} has no value", place, name));
  for (double x : values) {
    if (std::isnan(x)) throw ValueError(fmt::format("{}: {} is not a number", place, name));
  }
}

void check_order(const PerComponent& low, const PerComponent& high, std::string_view place) {
  const std::size_t n = std::max(low.size(), high.size());
  if (std::min(low.size(), high.size()) > 1 && low.size() != high.size()) {
    throw ValueError(
        fmt::format("{}: low has {} values and high {}", place, low.size(), high.size()));
  }
  for (int i = 0; i < static_cast<int>(n); ++i) {
    if (component(low, i) > component(high, i)) {
      throw ValueError(
          fmt::format("{}: low {} is above high {}", place, component(low, i), component(high, i)));
    }
  }
}

void check_components(const PerComponent& values, const char* name, const EffectInit& init) {
  if (values.size() != 1 && static_cast<int>(values.size()) != init.size) {
    throw ValueError(fmt::format("{}: {} has {} values: must be 1, or {} as the row has",
                                 init.place, name, values.size(), init.size));
  }
}

void check_numeric(const EffectInit& init) {
  if (init.dtype == DType::kFloat32 || init.dtype == DType::kFloat64) return;
  throw ValueError(fmt::format("{}: needs float32 or float64 values, the row has {}", init.place,
                               dtype_name(init.dtype)));
}

Draw Draw::gaussian(PerComponent std, PerComponent mean) {
  Draw d;
  d.kind = Kind::kGaussian;
  d.std = std::move(std);
  d.mean = std::move(mean);
  return d;
}

Draw Draw::uniform(PerComponent low, PerComponent high) {
  Draw d;
  d.kind = Kind::kUniform;
  d.low = std::move(low);
  d.high = std::move(high);
  return d;
}

Draw Draw::constant(PerComponent value) {
  Draw d;
  d.kind = Kind::kConstant;
  d.value = std::move(value);
  return d;
}

void Draw::validate(std::string_view place) const {
  const std::pair<const char*, const PerComponent*> all[] = {
      {"mean", &mean}, {"std", &std}, {"low", &low}, {"high", &high}, {"value", &value}};
  for (const auto& [name, values] : all) {
    check_values(*values, place, name);
    require_finite(*values, place, name);
  }
  require_not_negative(std, place, "std");
  check_order(low, high, place);
}

void Draw::check(const EffectInit& init) const {
  check_components(mean, "mean", init);
  check_components(std, "std", init);
  check_components(low, "low", init);
  check_components(high, "high", init);
  check_components(value, "value", init);
}

double Draw::sample(Rng& rng, int i) const {
  switch (kind) {
    case Kind::kGaussian:
      return component(mean, i) + component(std, i) * rng.normal();
    case Kind::kUniform:
      return rng.uniform(component(low, i), component(high, i));
    case Kind::kConstant:
      break;
  }
  return component(value, i);
}

Operation operation_from_name(std::string_view name) {
  if (name == "add") return Operation::kAdd;
  if (name == "scale") return Operation::kScale;
  if (name == "abs") return Operation::kAbs;
  throw ValueError(fmt::format("operation is '{}': must be one of add, scale, abs", name));
}

}  // namespace mjsense
