// SPDX-License-Identifier: Apache-2.0
#pragma once
// Errors in time: delay, jitter, a lower rate, and lost rows. Rows can have any element type unless
// noted.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/effects/effect.h"

namespace mjsense::effects {

// Ring buffer of the last rows of every world, with their times.
class FrameRing {
 public:
  void initialize(int num_worlds, std::size_t row_bytes, int capacity);
  void clear(int world) { count_[world] = 0; }
  void push(int world, const std::byte* row, double time);
  void replace_newest(int world, const std::byte* row);
  int count(int world) const { return count_[world]; }
  // Age 0 is the newest row. Ages beyond the oldest row give the oldest.
  const std::byte* frame(int world, int age) const;
  double time(int world, int age) const;

 private:
  std::size_t index(int world, int age) const;

  int capacity_ = 0;
  std::size_t row_bytes_ = 0;
  std::vector<std::byte> frames_;  // [B, capacity, row]
  std::vector<double> times_;      // [B, capacity]
  std::vector<int> newest_, count_;
};

// The output at time t is the row measured at t - lag, lag = delay + jitter.
//   delay   drawn for each world and episode from [delay_s, delay_max_s]; fixed if
//           delay_max_s < delay_s
//   jitter  uniform in [-jitter_s, jitter_s], drawn for every row; the output never goes back in
//           time
// Without interpolation it is the newest row that is not younger than t - lag. If there is none, it
// is the first row of the episode.
struct Delay : Effect {
  double delay_s = 0.0, delay_max_s = 0.0, jitter_s = 0.0;
  bool interpolate = false;  // linear between rows; float rows only

  Delay() = default;
  explicit Delay(double delay_s) : delay_s(delay_s) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Delay>(*this); }
  std::string kind() const override { return "delay"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
  bool needs_every_step() const override { return true; }

 private:
  std::uint32_t stream_ = 0;
  FrameRing ring_;
  std::vector<double> lag_, output_time_;  // [B], s
};
template <class V>
void visit_fields(V& v, Delay& c) {
  v.object("Delay", "Delays the rows by a time.", "delay").frozen().module("effects");
  v("delay_s", c.delay_s, "The delay.").at_least(0);
  v("delay_max_s", c.delay_max_s,
    "If larger than delay_s, the delay is drawn between the two for each world and episode.")
      .at_least(0);
  v("jitter_s", c.jitter_s, "Jitter, uniform in +-jitter_s and drawn anew for every row.")
      .at_least(0);
  v("interpolate", c.interpolate, "Interpolate linearly between rows; floating-point fields only.");
  v.include(static_cast<Effect&>(c));
}

// mjlab's delay, in rows. The output is the row `lag` rows ago, or the first row since the reset if
// there are fewer. lag is uniform in [min_lag, max_lag] and drawn every update_period rows (0:
// every row); with hold_probability the previous lag is kept.
struct StepDelay : Effect {
  int min_lag = 0, max_lag = 0;
  bool per_world = true;  // false: all worlds have the same lag
  double hold_probability = 0.0;
  int update_period = 0;
  bool per_world_phase = true;  // each world draws at its own phase, if update_period > 0

  StepDelay() = default;
  StepDelay(int min_lag, int max_lag) : min_lag(min_lag), max_lag(max_lag) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<StepDelay>(*this); }
  std::string kind() const override { return "step_delay"; }
  void validate(std::string_view context) const override;
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
  bool needs_every_step() const override { return true; }

 private:
  void draw_lag(const EffectTime& moment);

  std::uint32_t stream_ = 0;
  FrameRing ring_;
  std::vector<int> lag_, rows_, phase_;  // [B]
};
template <class V>
void visit_fields(V& v, StepDelay& c) {
  v.object("StepDelay", "mjlab's delay, in control steps.", "step_delay")
      .frozen()
      .module("effects");
  v("min_lag", c.min_lag, "Minimum lag.").at_least(0);
  v("max_lag", c.max_lag, "Maximum lag; the lag is drawn between the two.").at_least(0);
  v("per_world", c.per_world, "Draw a lag for each world. False: all worlds have the same lag.");
  v("hold_probability", c.hold_probability,
    "Probability that a drawn lag is discarded and the previous one is kept.")
      .within(0, 1);
  v("update_period", c.update_period, "Number of steps between draws; 0: every step.").at_least(0);
  v("per_world_phase", c.per_world_phase, "Give each world its own phase for the draws.");
  v.include(static_cast<Effect&>(c));
}

// A device that is slower than the control loop: it measures at phase + k / rate_hz, and the row is
// held in between.
struct Rate : Effect {
  double rate_hz = 0.0;
  double phase_s = 0.0;
  bool random_phase = false;  // drawn uniformly over a period, for each world and episode

  Rate() = default;
  explicit Rate(double rate_hz, double phase_s = 0.0) : rate_hz(rate_hz), phase_s(phase_s) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Rate>(*this); }
  std::string kind() const override { return "rate"; }
  void initialize(const EffectInit& init) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
  bool needs_every_step() const override { return true; }

 private:
  std::uint32_t stream_ = 0;
  std::size_t row_bytes_ = 0;
  std::vector<std::byte> held_;       // [B, row]
  std::vector<double> phase_;         // [B], s
  std::vector<std::int64_t> number_;  // [B], number of the held row
  std::vector<std::uint8_t> is_new_;  // [B], whether the row of the current tick was measured
};
template <class V>
void visit_fields(V& v, Rate& c) {
  v.object("Rate", "A device that is slower than the control loop: rows are held in between.",
           "rate")
      .frozen()
      .module("effects");
  v("rate_hz", c.rate_hz, "Number of new rows per second.").positive();
  v("phase_s", c.phase_s, "Time of the first row.");
  v("random_phase", c.random_phase,
    "Draw the phase uniformly over one period, for each world and episode.");
  v.include(static_cast<Effect&>(c));
}

// A row is lost with the given probability; the last row that arrived, NaN or 0 is reported
// instead. The first row of an episode always arrives.
enum class DropoutMode { kHold, kNan, kZero };
constexpr std::array<std::string_view, 3> enum_names(DropoutMode) {
  return {"hold", "nan", "zero"};
}

struct Dropout : Effect {
  using Mode = DropoutMode;
  double probability = 0.0;
  NamedEnum<Mode> mode = Mode::kHold;

  Dropout() = default;
  explicit Dropout(double probability, Mode mode = Mode::kHold)
      : probability(probability), mode(mode) {}
  std::unique_ptr<Effect> clone() const override { return std::make_unique<Dropout>(*this); }
  std::string kind() const override { return "dropout"; }
  void initialize(const EffectInit& init) override;
  void reset(const EffectTime& moment) override;
  void apply(const EffectTime& moment, const EffectRow& row) override;
  bool needs_every_step() const override { return mode == Mode::kHold; }

 private:
  std::uint32_t stream_ = 0;
  std::size_t row_bytes_ = 0;
  std::vector<std::byte> held_;        // [B, row]
  std::vector<std::int64_t> started_;  // [B] tick at which the episode began
};
template <class V>
void visit_fields(V& v, Dropout& c) {
  v.object("Dropout", "Loses rows with a given probability.", "dropout").frozen().module("effects");
  v("probability", c.probability,
    "Probability that a row is lost; the first row of an episode is never lost.")
      .within(0, 1);
  v("mode", c.mode, "The value reported instead; hold: the last row.");
  v.include(static_cast<Effect&>(c));
}

}  // namespace mjsense::effects
