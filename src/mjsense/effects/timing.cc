// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "mjsense/core/error.h"

namespace mjsense::effects {
namespace {

constexpr double kTimeEps = 1e-9;  // s, tolerance for the rounding of tick * period
constexpr int kMaxRows = 100'000;  // maximum number of rows that a ring keeps of a world

}  // namespace

void FrameRing::initialize(int num_worlds, std::size_t row_bytes, int capacity) {
  capacity_ = capacity;
  row_bytes_ = row_bytes;
  frames_.assign(static_cast<std::size_t>(num_worlds) * capacity * row_bytes, std::byte{0});
  times_.assign(static_cast<std::size_t>(num_worlds) * capacity, 0.0);
  newest_.assign(num_worlds, 0);
  count_.assign(num_worlds, 0);
}

void FrameRing::push(int world, const std::byte* row, double time) {
  newest_[world] = (newest_[world] + 1) % capacity_;
  count_[world] = std::min(count_[world] + 1, capacity_);
  times_[index(world, 0)] = time;
  replace_newest(world, row);
}

void FrameRing::replace_newest(int world, const std::byte* row) {
  std::memcpy(frames_.data() + index(world, 0) * row_bytes_, row, row_bytes_);
}

std::size_t FrameRing::index(int world, int age) const {
  return static_cast<std::size_t>(world) * capacity_ +
         (newest_[world] - age + capacity_) % capacity_;
}

const std::byte* FrameRing::frame(int world, int age) const {
  return frames_.data() + index(world, std::min(age, count_[world] - 1)) * row_bytes_;
}

double FrameRing::time(int world, int age) const {
  return times_[index(world, std::min(age, count_[world] - 1))];
}

void Delay::initialize(const EffectInit& init) {
  if (interpolate) check_numeric(init);
  if (!(init.period > 0)) throw ValueError(fmt::format("{}: needs a period > 0", init.context));
  const double rows = (std::max(delay_s, delay_max_s) + jitter_s) / init.period;
  if (!(rows <= kMaxRows)) {
    throw ValueError(fmt::format("{}: the delay is {:.3g} rows of {:.3g} s: the maximum is {} rows",
                                 init.context, rows, init.period, kMaxRows));
  }
  ring_.initialize(init.num_worlds, init.size * dtype_size(init.dtype),
                   static_cast<int>(std::ceil(rows)) + 2);
  lag_.assign(init.num_worlds, 0.0);
  output_time_.assign(init.num_worlds, 0.0);
  stream_ = init.stream;
}

void Delay::apply(const EffectTime& moment, const EffectRow& row) {
  const int w = moment.world;
  if (moment.advance) {
    if (moment.first) {
      ring_.clear(w);
      lag_[w] = delay_s;
      output_time_[w] = -std::numeric_limits<double>::infinity();
      if (delay_max_s > delay_s)
        lag_[w] = moment.episode_rng(stream_).uniform(delay_s, delay_max_s);
    }
    ring_.push(w, row.data, moment.time);
  } else {
    ring_.replace_newest(w, row.data);
  }
  double jitter = 0.0;
  if (jitter_s > 0) jitter = moment.rng(stream_ ^ 0x9e3779b9u).uniform(-jitter_s, jitter_s);
  const double lag = std::max(0.0, lag_[w] + jitter);
  output_time_[w] = std::max(output_time_[w], moment.time - lag);
  const double t = output_time_[w];
  int age = 0;
  while (age + 1 < ring_.count(w) && ring_.time(w, age) > t + kTimeEps) ++age;
  const double before = ring_.time(w, age);
  if (interpolate && age > 0 && t > before + kTimeEps) {
    const double f = (t - before) / (ring_.time(w, age - 1) - before);
    const EffectRow old{const_cast<std::byte*>(ring_.frame(w, age)), row.dtype, row.size};
    const EffectRow next{const_cast<std::byte*>(ring_.frame(w, age - 1)), row.dtype, row.size};
    row.transform([&](double, int i) { return old.at(i) + f * (next.at(i) - old.at(i)); });
  } else {
    std::memcpy(row.data, ring_.frame(w, age), row.bytes());
  }
}

void StepDelay::validate(std::string_view context) const {
  if (max_lag > kMaxRows)
    throw ValueError(
        fmt::format("{}: max_lag is {}: must be at most {}", context, max_lag, kMaxRows));
  if (max_lag < min_lag) {
    throw ValueError(fmt::format("{}: lags [{}, {}]: must satisfy 0 <= min_lag <= max_lag", context,
                                 min_lag, max_lag));
  }
}

void StepDelay::initialize(const EffectInit& init) {
  ring_.initialize(init.num_worlds, init.size * dtype_size(init.dtype), max_lag + 1);
  lag_.assign(init.num_worlds, 0);
  rows_.assign(init.num_worlds, 0);
  phase_.assign(init.num_worlds, 0);
  stream_ = init.stream;
}

void StepDelay::draw_lag(const EffectTime& moment) {
  const int w = moment.world;
  EffectTime source = moment;
  if (!per_world) source.key = 0;
  Rng rng = source.rng(stream_);
  const int lag = min_lag + static_cast<int>(rng.below(max_lag - min_lag + 1));
  const bool hold = rng.uniform() < hold_probability;
  if (moment.first) {
    lag_[w] = lag;
    rows_[w] = 0;
    const bool phases = per_world_phase && update_period > 0;
    phase_[w] = phases ? static_cast<int>(moment.episode_rng(stream_).below(update_period)) : 0;
  } else if (!hold && (update_period == 0 || (rows_[w] + phase_[w]) % update_period == 0)) {
    lag_[w] = lag;
  }
  ++rows_[w];
}

void StepDelay::apply(const EffectTime& moment, const EffectRow& row) {
  const int w = moment.world;
  if (moment.advance) {
    if (moment.first) ring_.clear(w);
    draw_lag(moment);
    ring_.push(w, row.data, moment.time);
  } else {
    ring_.replace_newest(w, row.data);
  }
  std::memcpy(row.data, ring_.frame(w, lag_[w]), row.bytes());
}

void Rate::initialize(const EffectInit& init) {
  row_bytes_ = init.size * dtype_size(init.dtype);
  held_.assign(init.num_worlds * row_bytes_, std::byte{0});
  phase_.assign(init.num_worlds, phase_s);
  number_.assign(init.num_worlds, 0);
  is_new_.assign(init.num_worlds, 0);
  stream_ = init.stream;
}

void Rate::apply(const EffectTime& moment, const EffectRow& row) {
  const int w = moment.world;
  if (moment.advance) {
    if (moment.first && random_phase) {
      phase_[w] = moment.episode_rng(stream_).uniform() / rate_hz;
    }
    const double number = std::floor((moment.time - phase_[w]) * rate_hz + 1e-6);
    is_new_[w] = moment.first || static_cast<std::int64_t>(number) != number_[w];
    number_[w] = static_cast<std::int64_t>(number);
  }
  std::byte* held = held_.data() + w * row_bytes_;
  if (is_new_[w]) {
    std::memcpy(held, row.data, row_bytes_);
  } else {
    std::memcpy(row.data, held, row_bytes_);
  }
}

void Dropout::initialize(const EffectInit& init) {
  if (mode == Mode::kNan) check_numeric(init);
  row_bytes_ = init.size * dtype_size(init.dtype);
  if (mode == Mode::kHold) held_.assign(init.num_worlds * row_bytes_, std::byte{0});
  started_.assign(init.num_worlds, 0);
  stream_ = init.stream;
}

void Dropout::reset(const EffectTime& moment) { started_[moment.world] = moment.tick; }

void Dropout::apply(const EffectTime& moment, const EffectRow& row) {
  // Without memory, the first row that is read may be a later one than the first of the episode.
  const bool first = mode == Mode::kHold ? moment.first : moment.tick == started_[moment.world];
  const bool lost = !first && moment.rng(stream_).uniform() < probability;
  if (mode == Mode::kHold) {
    std::byte* held = held_.data() + moment.world * row_bytes_;
    std::memcpy(lost ? row.data : held, lost ? held : row.data, row_bytes_);
  } else if (lost && mode == Mode::kZero) {
    std::memset(row.data, 0, row_bytes_);
  } else if (lost) {
    row.transform([](double, int) { return std::numeric_limits<double>::quiet_NaN(); });
  }
}

}  // namespace mjsense::effects
