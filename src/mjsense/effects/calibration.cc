// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "mjsense/core/error.h"
#include "mjsense/core/system/print_stderr.h"
#include "mjsense/core/text/counted.h"

namespace mjsense::effects {

void Scale::initialize(const EffectInit& init) {
  check_numeric(init);
  check_components(factor, "factor", init);
}

void Scale::apply(const EffectTime& /*moment*/, const EffectRow& row) {
  row.transform([&](double x, int i) { return x * component(factor, i); });
}

void Misalignment::initialize(const EffectInit& init) {
  check_numeric(init);
  if (init.size % 3 != 0) {
    throw ValueError(fmt::format("{}: the row must consist of 3-vectors; it has {}", init.context,
                                 counted(init.size, "value")));
  }
  stream_ = init.stream;
  matrix_.assign(static_cast<std::size_t>(init.num_worlds) * 9, 0.0);
  drawn_.assign(init.num_worlds, 0);
}

void Misalignment::reset(const EffectTime& moment) {
  Rng rng = moment.episode_rng(stream_);
  double s[3], a[3];
  for (int i = 0; i < 3; ++i) s[i] = 1.0 + scale_error[i] + scale_error_std * rng.normal();
  for (int i = 0; i < 3; ++i) a[i] = angle[i] + angle_std * rng.normal();
  // R = Rz Ry Rx
  const double cx = std::cos(a[0]), sx = std::sin(a[0]), cy = std::cos(a[1]), sy = std::sin(a[1]),
               cz = std::cos(a[2]), sz = std::sin(a[2]);
  const double R[9] = {cz * cy,
                       cz * sy * sx - sz * cx,
                       cz * sy * cx + sz * sx,
                       sz * cy,
                       sz * sy * sx + cz * cx,
                       sz * sy * cx - cz * sx,
                       -sy,
                       cy * sx,
                       cy * cx};
  double* M = matrix_.data() + static_cast<std::size_t>(moment.world) * 9;
  for (int i = 0; i < 9; ++i) M[i] = s[i / 3] * R[i];
  drawn_[moment.world] = 1;
}

void Misalignment::apply(const EffectTime& moment, const EffectRow& row) {
  if (!drawn_[moment.world]) reset(moment);
  const double* M = matrix_.data() + static_cast<std::size_t>(moment.world) * 9;
  double v[3], out[3];
  for (int begin = 0; begin < row.size; begin += 3) {
    const std::size_t item = dtype_size(row.dtype);
    const EffectRow part{row.data + begin * item, row.dtype, 3};
    part.transform([&](double x, int i) { return v[i] = x; });
    for (int i = 0; i < 3; ++i)
      out[i] = M[3 * i] * v[0] + M[3 * i + 1] * v[1] + M[3 * i + 2] * v[2];
    part.transform([&](double, int i) { return out[i]; });
  }
}

void Clip::validate(std::string_view context) const { check_order(low, high, context); }

void Clip::initialize(const EffectInit& init) {
  check_numeric(init);
  check_components(low, "low", init);
  check_components(high, "high", init);
}

void Clip::apply(const EffectTime& /*moment*/, const EffectRow& row) {
  row.transform([&](double x, int i) {  // NaN stays NaN
    return x < component(low, i)    ? component(low, i)
           : x > component(high, i) ? component(high, i)
                                    : x;
  });
}

void Quantize::initialize(const EffectInit& init) {
  check_numeric(init);
  check_components(step, "step", init);
}

void Quantize::apply(const EffectTime& /*moment*/, const EffectRow& row) {
  row.transform([&](double x, int i) {
    const double s = component(step, i);
    return s > 0 ? s * std::round(x / s) : x;
  });
}

void NanPolicy::initialize(const EffectInit& init) {
  check_numeric(init);
  context_ = init.context;
  warned_.assign(init.num_worlds, 0);
}

void NanPolicy::apply(const EffectTime& moment, const EffectRow& row) {
  if (action == Action::kDisabled) return;
  int bad = 0, where = -1;
  row.transform([&](double x, int i) {
    if (std::isfinite(x)) return x;
    if (bad++ == 0) where = i;
    return action == Action::kSanitize ? 0.0 : x;
  });
  if (bad == 0) return;
  if (action == Action::kError) {
    throw RuntimeError(
        fmt::format("{}: {} of {} values are not finite in world {} (first: index {})", context_,
                    bad, row.size, moment.world, where));
  }
  if (action == Action::kWarn && !warned_[moment.world]) {
    warned_[moment.world] = 1;
    print_stderr("{}: {} of {} values are not finite in world {}\n", context_, bad, row.size,
                 moment.world);
  }
}

}  // namespace mjsense::effects
