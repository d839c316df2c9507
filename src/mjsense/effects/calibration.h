// SPDX-License-Identifier: Apache-2.0
#pragma once
// Errors of a measuring device that do not vary within an episode: scale, misalignment, range,
// resolution, and non-finite values.

#include <array>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/effects/effect.h"

namespace mjsense::effects {

// x <- factor x
struct Scale : Effect {
  PerComponent factor = {1.0};

  Scale() = default;
  explicit Scale(PerComponent factor) : factor(std::move(factor)) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Scale>(*this); }
  std::string kind() const override { return "scale"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
};
template <class V>
void visit_fields(V& v, Scale& c) {
  v.object("Scale", "Multiplies values by a factor.", "scale").frozen().module("effects");
  v("factor", c.factor, "The factor.").or_one().not_empty();
  v.include(static_cast<Effect&>(c));
}

// v <- M v for every three components, M = (I + diag(s)) R(a): relative scale errors s and
// misalignment angles a (rad) about x, y, z. Each is the sum of a fixed value and a Gaussian drawn
// at every reset.
struct Misalignment : Effect {
  std::array<double, 3> scale_error{0, 0, 0}, angle{0, 0, 0};
  double scale_error_std = 0.0, angle_std = 0.0;

  std::unique_ptr<Effect> clone() const override { return std::make_unique<Misalignment>(*this); }
  std::string kind() const override { return "misalignment"; }
  void initialize(const EffectInit& init) override;
  void reset(const EffectTime& moment) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;

 private:
  std::uint32_t stream_ = 0;
  std::vector<double> matrix_;       // [B, 3, 3]
  std::vector<std::uint8_t> drawn_;  // [B]
};
template <class V>
void visit_fields(V& v, Misalignment& c) {
  v.object("Misalignment",
           "Scale errors and small rotations of each group of three components: a fixed part, and "
           "a part drawn at every reset.",
           "misalignment")
      .frozen()
      .module("effects");
  v("scale_error", c.scale_error, "Fixed scale errors of x, y, z.");
  v("angle", c.angle, "Fixed rotation about x, y, z.").unit("rad");
  v("scale_error_std", c.scale_error_std, "Standard deviation of the drawn scale errors.")
      .at_least(0);
  v("angle_std", c.angle_std, "Standard deviation of the drawn rotation.").unit("rad").at_least(0);
  v.include(static_cast<Effect&>(c));
}

// x <- min(max(x, low), high): the range of a device (saturation), or the clipping of an
// observation.
struct Clip : Effect {
  PerComponent low = {-std::numeric_limits<double>::infinity()};
  PerComponent high = {std::numeric_limits<double>::infinity()};

  Clip() = default;
  Clip(PerComponent low, PerComponent high) : low(std::move(low)), high(std::move(high)) {}
  static Clip saturation(double range) { return {{-range}, {range}}; }
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Clip>(*this); }
  std::string kind() const override { return "clip"; }
  void validate(std::string_view context) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
};
template <class V>
void visit_fields(V& v, Clip& c) {
  v.object("Clip", "Clips values to the limits of a device or of an observation.", "clip")
      .frozen()
      .module("effects");
  v("low", c.low, "Lower limit.").may_be_infinite().or_one().not_empty();
  v("high", c.high, "Upper limit.").may_be_infinite().or_one().not_empty();
  v.include(static_cast<Effect&>(c));
}

// x <- step round(x / step), halves away from zero: the resolution of an analog-to-digital
// converter.
struct Quantize : Effect {
  PerComponent step = {0.0};  // unit of the row; 0: no rounding

  Quantize() = default;
  explicit Quantize(PerComponent step) : step(std::move(step)) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Quantize>(*this); }
  std::string kind() const override { return "quantize"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
};
template <class V>
void visit_fields(V& v, Quantize& c) {
  v.object("Quantize", "Rounds values to multiples of a step.", "quantize")
      .frozen()
      .module("effects");
  v("step", c.step, "Resolution; 0: no rounding.").at_least(0).or_one().not_empty();
  v.include(static_cast<Effect&>(c));
}

// What happens to NaN and infinite values.
enum class NanAction { kDisabled, kWarn, kSanitize, kError };
constexpr std::array<std::string_view, 4> enum_names(NanAction) {
  return {"disabled", "warn", "sanitize", "error"};
}

struct NanPolicy : Effect {
  using Action = NanAction;
  NamedEnum<Action> action = Action::kSanitize;

  NanPolicy() = default;
  explicit NanPolicy(Action action) : action(action) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<NanPolicy>(*this); }
  std::string kind() const override { return "nan_policy"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;

 private:
  std::string context_;
  std::vector<std::uint8_t> warned_;  // [B]
};
template <class V>
void visit_fields(V& v, NanPolicy& c) {
  v.object("NanPolicy", "Handles NaN and infinite values.", "nan_policy")
      .frozen()
      .module("effects");
  v("action", c.action,
    "disabled: keep them; warn: print one warning on stderr; sanitize: replace them by 0; error: "
    "raise RuntimeError.");
  v.include(static_cast<Effect&>(c));
}

}  // namespace mjsense::effects
