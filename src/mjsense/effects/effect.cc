#include "mjsense/effects/effect.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "mjsense/core/error.h"

namespace mjsense {

void check_components(const PerComponent& values, const char* name, const EffectInit& init) {
  if (values.size() != 1 && static_cast<int>(values.size()) != init.size) {
    throw ValueError(fmt::format("{}: {} has {} values: must be 1, or {} as the row has",
                                 init.place, name, values.size(), init.size));
  }
  for (double x : values) {
    if (std::isnan(x)) throw ValueError(fmt::format("{}: {} is not a number", init.place, name));
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

void Draw::check(const EffectInit& init) const {
  check_components(mean, "mean", init);
  check_components(std, "std", init);
  check_components(low, "low", init);
  check_components(high, "high", init);
  check_components(value, "value", init);
  for (int i = 0; i < init.size; ++i) {
    if (component(std, i) < 0) {
      throw ValueError(
          fmt::format("{}: std is {}: must not be negative", init.place, component(std, i)));
    }
    if (component(low, i) > component(high, i)) {
      throw ValueError(fmt::format("{}: low {} is above high {}", init.place, component(low, i),
                                   component(high, i)));
    }
  }
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
  throw ValueError(fmt::format("operation '{}': must be add, scale or abs", name));
}

}  // namespace mjsense
