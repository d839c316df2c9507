#pragma once
// Deterministic errors of a measuring device: scale, misalignment, range, resolution, invalid
// numbers.

#include <array>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/effects/effect.h"

namespace mjsense {

// x <- factor x
struct Scale : Effect {
  PerComponent factor = {1.0};

  Scale() = default;
  explicit Scale(PerComponent factor) : factor(std::move(factor)) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Scale>(*this); }
  std::string kind() const override { return "scale"; }
  void validate(std::string_view place) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectMoment& moment, const EffectRow& row) override;
};

// v <- M v for every three components, M = (I + diag(s)) R(a): scale errors s (1) and misalignment
// angles a (rad) about x, y, z, each fixed plus a Gaussian drawn at every reset.
struct Misalignment : Effect {
  std::array<double, 3> scale_error{0, 0, 0}, angle{0, 0, 0};
  double scale_error_std = 0.0, angle_std = 0.0;

  std::unique_ptr<Effect> clone() const override { return std::make_unique<Misalignment>(*this); }
  std::string kind() const override { return "misalignment"; }
  void validate(std::string_view place) const override;
  void initialize(const EffectInit& init) override;
  void reset(const EffectMoment& moment) override;
  void apply(const EffectMoment& moment, const EffectRow& row) override;

 private:
  std::uint32_t stream_ = 0;
  std::vector<double> matrix_;       // [B, 3, 3]
  std::vector<std::uint8_t> drawn_;  // by world
};

// x <- min(max(x, low), high): the range of a device (saturation), or a clip of an observation.
struct Clip : Effect {
  PerComponent low = {-std::numeric_limits<double>::infinity()};
  PerComponent high = {std::numeric_limits<double>::infinity()};

  Clip() = default;
  Clip(PerComponent low, PerComponent high) : low(std::move(low)), high(std::move(high)) {}
  static Clip saturation(double range) { return {{-range}, {range}}; }
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Clip>(*this); }
  std::string kind() const override { return "clip"; }
  void validate(std::string_view place) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectMoment& moment, const EffectRow& row) override;
};

// x <- step round(x / step), halves away from zero: one count of an analog-digital converter.
struct Quantize : Effect {
  PerComponent step = {0.0};  // unit; 0: none

  Quantize() = default;
  explicit Quantize(PerComponent step) : step(std::move(step)) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Quantize>(*this); }
  std::string kind() const override { return "quantize"; }
  void validate(std::string_view place) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectMoment& moment, const EffectRow& row) override;
};

// What becomes of NaN and infinite values.
struct NanPolicy : Effect {
  enum class Action { kDisabled, kWarn, kSanitize, kError };
  Action action = Action::kSanitize;  // warn: said once on stderr. sanitize: 0. error: RuntimeError

  NanPolicy() = default;
  explicit NanPolicy(Action action) : action(action) {}
  static Action action_from_name(std::string_view name);  // throws ValueError
  std::unique_ptr<Effect> clone() const override { return std::make_unique<NanPolicy>(*this); }
  std::string kind() const override { return "nan_policy"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectMoment& moment, const EffectRow& row) override;

 private:
  std::string place_;
  std::vector<std::uint8_t> warned_;  // by world
};

}  // namespace mjsense
