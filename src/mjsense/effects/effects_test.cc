// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <set>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/allocations.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/effect_sensor.h"
#include "mjsense/effects/pipeline.h"

namespace mjsense::effects {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kPeriod = 0.01;  // s

// An effect chain on rows of floats, which the test supplies.
class Bench {
 public:
  Bench(const EffectChainCfg& cfg, int size, int num_worlds = 1, std::uint64_t seed = 1)
      : seed_(seed),
        chain_("test", spec(size), cfg, num_worlds, kPeriod, kPeriod),
        out_(chain_.spec().shape.size() * num_worlds) {}
  Bench(Effects effects, int size, int num_worlds = 1, std::uint64_t seed = 1)
      : Bench(EffectChainCfg{std::move(effects)}, size, num_worlds, seed) {}

  std::vector<float> feed_row(std::vector<float> row, std::int64_t tick, int world = 0) {
    const std::size_t n = out_.size() / num_worlds();
    float* out = out_.data() + world * n;
    chain_.apply(at(tick, world), std::as_bytes(std::span(row)),
                 std::as_writable_bytes(std::span(out, n)));
    return {out, out + n};
  }
  float feed(float x, std::int64_t tick, int world = 0) { return feed_row({x}, tick, world)[0]; }
  void reset(std::int64_t tick, std::int64_t episode, int world = 0) {
    episode_ = episode;
    chain_.reset(at(tick, world));
  }
  EffectChain& chain() { return chain_; }

 private:
  static SensorSpec spec(int size) {
    SensorSpec s;
    s.shape = {size};
    return s;
  }
  int num_worlds() const { return static_cast<int>(out_.size() / chain_.spec().shape.size()); }
  ChainTick at(std::int64_t tick, int world) const {
    return {world, static_cast<std::uint32_t>(world), seed_, tick, episode_};
  }
  std::uint64_t seed_;
  std::int64_t episode_ = 1;
  EffectChain chain_;
  std::vector<float> out_;
};

template <class E>
Effects one(E effect) {
  return {std::make_shared<E>(std::move(effect))};
}

struct Moments {
  double mean, variance;
};
Moments moments(const std::vector<double>& x) {
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / x.size();
  double sum = 0;
  for (double v : x) sum += (v - mean) * (v - mean);
  return {mean, sum / (x.size() - 1)};
}

std::vector<double> series(Bench& bench, int n, float value = 0.0f) {
  std::vector<double> x;
  for (int t = 0; t < n; ++t) x.push_back(bench.feed(value, t));
  return x;
}

// Allan deviation at m samples (non-overlapping averages).
double allan(const std::vector<double>& x, int m) {
  std::vector<double> averages;
  for (std::size_t i = 0; i + m <= x.size(); i += m) {
    averages.push_back(std::accumulate(x.begin() + i, x.begin() + i + m, 0.0) / m);
  }
  double sum = 0;
  for (std::size_t i = 1; i < averages.size(); ++i) {
    sum += (averages[i] - averages[i - 1]) * (averages[i] - averages[i - 1]);
  }
  return std::sqrt(sum / (2.0 * (averages.size() - 1)));
}

// ---- noise

TEST(Noise, GaussianAndUniformHaveTheirMoments) {
  constexpr int kN = 200000;
  Bench gauss(one(Noise(Draw::gaussian({0.5}, {0.1}))), 1);
  const Moments g = moments(series(gauss, kN, 2.0f));
  EXPECT_NEAR(g.mean, 2.1, 5 * 0.5 / std::sqrt(kN));
  EXPECT_NEAR(g.variance, 0.25, 5 * 0.25 * std::sqrt(2.0 / kN));
  Bench uniform(one(Noise(Draw::uniform({-1}, {3}))), 1);
  const std::vector<double> x = series(uniform, kN);
  const Moments u = moments(x);
  EXPECT_NEAR(u.mean, 1.0, 5 * std::sqrt(16.0 / 12 / kN));
  EXPECT_NEAR(u.variance, 16.0 / 12, 0.02);
  EXPECT_GE(*std::ranges::min_element(x), -1);
  EXPECT_LT(*std::ranges::max_element(x), 3.00001);
}

TEST(Noise, DensityIsTheAllanDeviationAtOneSecondAndFallsWithRootTau) {
  Bench bench(one(Noise::with_density({0.02})), 1);
  const std::vector<double> x = series(bench, 400000);
  for (int m : {1, 10, 100, 1000}) {
    const double tau = m * kPeriod;
    EXPECT_NEAR(allan(x, m) * std::sqrt(tau) / 0.02, 1.0, 5 * std::sqrt(0.75 * m / x.size()));
  }
}

TEST(Noise, IsWhiteAcrossTimeComponentsAndWorlds) {
  constexpr int kN = 50000;
  Bench bench(one(Noise(Draw::gaussian({1.0}))), 2, 2);
  std::vector<double> a, b, c;
  for (int t = 0; t < kN; ++t) {
    const std::vector<float> row = bench.feed_row({0, 0}, t, 0);
    a.push_back(row[0]);
    b.push_back(row[1]);
    c.push_back(bench.feed_row({0, 0}, t, 1)[0]);
  }
  const auto correlation = [&](const std::vector<double>& x, const std::vector<double>& y,
                               int lag) {
    double sum = 0;
    for (int i = lag; i < kN; ++i) sum += x[i] * y[i - lag];
    return sum / kN;
  };
  const double bound = 5 / std::sqrt(kN);
  EXPECT_LT(std::abs(correlation(a, a, 1)), bound);
  EXPECT_LT(std::abs(correlation(a, a, 7)), bound);
  EXPECT_LT(std::abs(correlation(a, b, 0)), bound);
  EXPECT_LT(std::abs(correlation(a, c, 0)), bound);
}

TEST(Noise, NumbersDependOnTheTickOnly) {
  Bench forward(one(Noise(Draw::gaussian({1.0}))), 3),
      backward(one(Noise(Draw::gaussian({1.0}))), 3);
  Bench other(one(Noise(Draw::gaussian({1.0}))), 3, 1, 2);
  std::vector<std::vector<float>> rows;
  for (int t = 0; t < 20; ++t) rows.push_back(forward.feed_row({1, 2, 3}, t));
  for (int t = 19; t >= 0; --t) EXPECT_EQ(backward.feed_row({1, 2, 3}, t), rows[t]);
  EXPECT_NE(other.feed_row({1, 2, 3}, 0), rows[0]);
}

TEST(Noise, Operations) {
  Bench add(one(Noise(Draw::constant({0.25}))), 2);
  EXPECT_THAT(add.feed_row({1, 2}, 0), ElementsAre(1.25f, 2.25f));
  Bench scale(one(Noise(Draw::constant({2, 3}), Operation::kScale)), 2);
  EXPECT_THAT(scale.feed_row({1, 2}, 0), ElementsAre(2, 6));
  Bench abs(one(Noise(Draw::constant({0.25}), Operation::kAbs)), 2);
  EXPECT_THAT(abs.feed_row({1, 2}, 0), ElementsAre(0.25f, 0.25f));
}

TEST(EpisodeBias, IsConstantInAnEpisodeAndCanWalk) {
  Bench bench(one(EpisodeBias(Draw::gaussian({1.0}))), 1);
  std::vector<double> biases;
  for (int episode = 1; episode <= 4000; ++episode) {
    bench.reset(episode * 10, episode);
    const float b = bench.feed(0.0f, episode * 10);
    ASSERT_NEAR(bench.feed(5.0f, episode * 10 + 1), 5.0f + b, 2e-6);
    biases.push_back(b);
  }
  EXPECT_NEAR(moments(biases).variance, 1.0, 5 * std::sqrt(2.0 / 4000));
  Bench walk(one(EpisodeBias(Draw::constant({0.5}), Operation::kAdd)), 1);
  for (int episode = 1; episode <= 5; ++episode) {
    walk.reset(episode, episode);
    EXPECT_FLOAT_EQ(walk.feed(0.0f, episode), 0.5f * episode);
  }
  EpisodeBias shared(Draw::gaussian({1.0}));
  shared.per_component = false;
  Bench same(one(shared), 3);
  const std::vector<float> row = same.feed_row({0, 0, 0}, 0);
  EXPECT_TRUE(row[0] == row[1] && row[1] == row[2] && row[0] != 0);
}

TEST(BiasDrift, IsGaussMarkov) {
  BiasDrift drift;
  drift.std = {0.3};
  drift.time_constant_s = 0.2;  // 20 rows
  Bench bench(one(drift), 1);
  const std::vector<double> x = series(bench, 400000);
  const double independent = x.size() * kPeriod / (2 * 0.2);
  EXPECT_NEAR(moments(x).variance, 0.09, 5 * 0.09 * std::sqrt(2 / independent));
  for (int lag : {1, 10, 20, 60}) {
    double sum = 0;
    for (std::size_t i = lag; i < x.size(); ++i) sum += x[i] * x[i - lag];
    EXPECT_NEAR(sum / x.size() / 0.09, std::exp(-lag * kPeriod / 0.2), 5 / std::sqrt(independent));
  }
}

// The bias of episode n is not drawn from the numbers of tick n.
TEST(BiasDrift, TheFirstBiasIsIndependentOfTheTicks) {
  BiasDrift drift;
  drift.std = {1.0};
  drift.time_constant_s = 1e-6;  // every row is drawn anew
  Bench bench(one(drift), 1);
  const float first = bench.feed(0, 0);  // of episode 1
  EXPECT_NE(first, bench.feed(0, 1));
}

TEST(BiasDrift, WithoutTimeConstantIsARandomWalk) {
  BiasDrift walk;
  walk.density = {0.1};  // variance after t: 0.01 t
  std::vector<double> ends;
  for (int seed = 0; seed < 2000; ++seed) {
    Bench bench(one(walk), 1, 1, seed);
    ends.push_back(series(bench, 101).back());
  }
  EXPECT_NEAR(moments(ends).variance, 0.01, 5 * 0.01 * std::sqrt(2.0 / 2000));
}

// ---- calibration

TEST(Calibration, ClipScaleQuantize) {
  Bench bench(
      {std::make_shared<Clip>(Clip::saturation(2)), std::make_shared<Scale>(PerComponent{10}),
       std::make_shared<Quantize>(PerComponent{4})},
      4);
  EXPECT_THAT(bench.feed_row({-5, 0.3f, 0.5f, 1.1f}, 0), ElementsAre(-20, 4, 4, 12));
}

TEST(Calibration, MisalignmentRotatesAndScales) {
  Misalignment m;
  m.angle = {0, 0, std::numbers::pi / 2};
  m.scale_error = {0.1, 0, 0};
  Bench bench(one(m), 6);
  const std::vector<float> v = bench.feed_row({1, 0, 0, 0, 1, 2}, 0);
  EXPECT_NEAR(v[0], 0, 1e-6);
  EXPECT_NEAR(v[1], 1, 1e-6);
  EXPECT_NEAR(v[3], -1.1, 1e-6);
  EXPECT_NEAR(v[5], 2, 1e-6);
}

TEST(Calibration, NanPolicies) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Bench sanitize(one(NanPolicy(NanPolicy::Action::kSanitize)), 2);
  EXPECT_THAT(sanitize.feed_row({nan, 1}, 0), ElementsAre(0, 1));
  Bench error(one(NanPolicy(NanPolicy::Action::kError)), 2);
  try {
    error.feed_row({1, nan}, 0);
    FAIL();
  } catch (const RuntimeError& e) {
    EXPECT_STREQ(e.what(),
                 "sensor 'test', effect 0 (nan_policy): 1 of 2 values are not finite in world 0 "
                 "(first: index 1)");
  }
}

TEST(Calibration, InfinitiesAreHandledLikeNan) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  Bench sanitize(one(NanPolicy(NanPolicy::Action::kSanitize)), 4);
  EXPECT_THAT(sanitize.feed_row({inf, 1, -inf, nan}, 0), ElementsAre(0, 1, 0, 0));
  Bench disabled(one(NanPolicy(NanPolicy::Action::kDisabled)), 2);
  EXPECT_THAT(disabled.feed_row({inf, -inf}, 0), ElementsAre(inf, -inf));
  for (const float bad : {inf, -inf}) {
    Bench error(one(NanPolicy(NanPolicy::Action::kError)), 3);
    EXPECT_THROW(error.feed_row({1, 2, bad}, 0), RuntimeError) << bad;
  }
  Bench warn(one(NanPolicy(NanPolicy::Action::kWarn)), 2);
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(warn.feed_row({-inf, 2}, 0), ElementsAre(-inf, 2));  // warned about, but not changed
  warn.feed_row({-inf, 2}, 1);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "sensor 'test', effect 0 (nan_policy): 1 of 2 values are not finite in world 0\n");
}

// Scale errors apply to the axes of the device, after the rotation: M = diag(s) R.
TEST(Calibration, MisalignmentScalesTheDevicesAxes) {
  Misalignment m;
  m.scale_error = {0.1, 0.0, -0.2};
  m.angle = {0, 0, std::numbers::pi / 2};  // the body's x is measured on the device's y
  Bench bench(one(m), 3);
  const std::vector<float> x = bench.feed_row({1, 0, 0}, 0);
  EXPECT_NEAR(x[0], 0, 1e-6);
  EXPECT_NEAR(x[1], 1, 1e-6);
  const std::vector<float> y = bench.feed_row({0, 1, 0}, 0);
  EXPECT_NEAR(y[0], -1.1, 1e-6);
  EXPECT_NEAR(y[1], 0, 1e-6);
  const std::vector<float> z = bench.feed_row({0, 0, 1}, 0);
  EXPECT_NEAR(z[2], 0.8, 1e-6);
}

TEST(Calibration, ClipsAtBothEnds) {
  Bench both(one(Clip({-2}, {3})), 3);
  EXPECT_THAT(both.feed_row({-5, 0, 5}, 0), ElementsAre(-2, 0, 3));
  Bench saturated(one(Clip::saturation(4)), 2);
  EXPECT_THAT(saturated.feed_row({-9, 9}, 0), ElementsAre(-4, 4));
}

// ---- time

// There is one delay per episode and world, drawn from the whole range.
TEST(Delay, IsDrawnAnewInEveryEpisode) {
  Delay d(0.01);
  d.delay_max_s = 0.05;
  Bench bench(one(d), 1);
  std::vector<double> lags;
  std::int64_t tick = 0;
  for (int episode = 1; episode <= 400; ++episode) {
    bench.reset(tick, episode);
    float x = 0;
    for (int t = 0; t < 20; ++t, ++tick) x = bench.feed(static_cast<float>(tick), tick);
    lags.push_back(static_cast<double>(tick - 1) - x);
  }
  const auto [minimum, maximum] = std::minmax_element(lags.begin(), lags.end());
  EXPECT_GE(*minimum, 1.0);
  EXPECT_LE(*maximum, 5.0);
  // 2 to 5 rows, because delays are rounded up.
  EXPECT_EQ(std::set<double>(lags.begin(), lags.end()).size(), 4u);
}

// The first row of an episode is never lost, because there would be no earlier row to hold.
TEST(Dropout, NeverLosesTheFirstRowOfAnEpisode) {
  Bench bench(one(Dropout(0.9)), 1);
  std::int64_t tick = 0;
  for (int episode = 1; episode <= 50; ++episode) {
    bench.reset(tick, episode);
    const float fresh = 100.0f * episode;
    ASSERT_EQ(bench.feed(fresh, tick++), fresh) << "episode " << episode;
    for (int t = 0; t < 5; ++t) ASSERT_GE(bench.feed(fresh + 1 + t, tick++), fresh);
  }
}

TEST(Delay, IsInSecondsAndLimitedToTheEpisode) {
  Bench bench(one(Delay(0.03)), 1);
  std::vector<float> out;
  for (int t = 0; t < 7; ++t) out.push_back(bench.feed(static_cast<float>(t), t));
  EXPECT_THAT(out, ElementsAre(0, 0, 0, 0, 1, 2, 3));
  bench.reset(7, 2);
  EXPECT_EQ(bench.feed(100.0f, 7), 100.0f);
  EXPECT_EQ(bench.feed(101.0f, 8), 100.0f);
}

TEST(Delay, InterpolatesBetweenRows) {
  Delay d(0.025);
  d.interpolate = true;
  Bench bench(one(d), 1);
  std::vector<float> out;
  for (int t = 0; t < 6; ++t) out.push_back(bench.feed(static_cast<float>(t), t));
  EXPECT_NEAR(out[3], 0.5, 1e-6);
  EXPECT_NEAR(out[5], 2.5, 1e-6);
}

TEST(Delay, RandomDelayIsDrawnPerWorldAndJitterNeverGoesBack) {
  Delay d(0.01);
  d.delay_max_s = 0.05;
  d.jitter_s = 0.02;
  Bench bench(one(d), 1, 64);
  std::vector<double> lags;
  for (int w = 0; w < 64; ++w) {
    float last = -1;
    for (int t = 0; t < 200; ++t) {
      const float x = bench.feed(static_cast<float>(t), t, w);
      ASSERT_GE(x, last);
      ASSERT_LE(t - x, 8.0f);
      last = x;
      if (t > 20) lags.push_back(t - x);
    }
  }
  EXPECT_GT(moments(lags).variance, 0.5);
}

TEST(Delay, RepeatedTickReplacesTheNewestRow) {
  Delay d(0.02);
  BiasDrift drift;
  drift.std = {1.0};
  drift.time_constant_s = 1.0;
  EffectChainCfg cfg;
  cfg.effects = {std::make_shared<BiasDrift>(drift), std::make_shared<Delay>(d)};
  cfg.history_length = 3;
  Bench once(cfg, 1), twice(cfg, 1);
  for (int t = 0; t < 30; ++t) {
    const std::vector<float> a = once.feed_row({static_cast<float>(t)}, t);
    twice.feed_row({-1000.0f}, t);
    twice.feed_row({500.0f}, t);
    ASSERT_EQ(twice.feed_row({static_cast<float>(t)}, t), a) << t;
  }
}

TEST(StepDelay, ConstantLagAndReset) {
  Bench bench(one(StepDelay(2, 2)), 1);
  std::vector<float> out;
  for (int t = 0; t < 6; ++t) out.push_back(bench.feed(static_cast<float>(t), t));
  EXPECT_THAT(out, ElementsAre(0, 0, 0, 1, 2, 3));
}

TEST(StepDelay, LagsAreUniformHeldAndShared) {
  Bench bench(one(StepDelay(1, 4)), 1);
  int counts[5] = {};
  for (int t = 0; t < 20010; ++t) {
    const int lag = t - static_cast<int>(bench.feed(static_cast<float>(t), t));
    if (t >= 10) ++counts[lag];
  }
  for (int lag = 1; lag <= 4; ++lag) EXPECT_NEAR(counts[lag], 5000, 5 * 62);
  StepDelay held(0, 9);
  held.hold_probability = 1.0;
  Bench hold(one(held), 1, 8);
  StepDelay together(0, 9);
  together.per_world = false;
  Bench shared(one(together), 1, 2);
  float lag = -1;
  for (int t = 0; t < 100; ++t) {
    ASSERT_EQ(shared.feed(static_cast<float>(t), t, 0), shared.feed(static_cast<float>(t), t, 1));
    const float x = hold.feed(static_cast<float>(t), t, 3);
    if (t == 10) lag = t - x;
    if (t > 10) {
      ASSERT_EQ(t - x, lag);
    }
  }
}

// Two delays of one sensor draw different lags.
TEST(StepDelay, LagsDependOnThePositionInTheChain) {
  Bench first(one(StepDelay(0, 9)), 1);
  Bench second({std::make_shared<Scale>(PerComponent{1}), std::make_shared<StepDelay>(0, 9)}, 1);
  int equal = 0;
  for (int t = 0; t < 100; ++t) {
    const float x = static_cast<float>(t);
    equal += first.feed(x, t) == second.feed(x, t);
  }
  EXPECT_LT(equal, 50);
}

// A lag is kept for `update_period` rows. With a phase per world, the worlds change their lags at
// different rows, otherwise at the same rows.
TEST(StepDelay, TheUpdatePeriodHasAPhaseForEachWorld) {
  constexpr int kWorlds = 40, kLags = 9, kUpdate = 5, kRows = 400;
  for (const bool per_world : {true, false}) {
    StepDelay delay(0, kLags);
    delay.update_period = kUpdate;
    delay.per_world_phase = per_world;
    Bench bench(one(delay), 1, kWorlds);
    std::set<int> phases;
    for (int w = 0; w < kWorlds; ++w) {
      std::set<int> of_world;
      float before = -1;
      for (int t = 0; t < kRows; ++t) {
        const float lag = t - bench.feed(static_cast<float>(t), t, w);
        if (t > kLags && lag != before) of_world.insert(t % kUpdate);
        before = lag;
      }
      ASSERT_EQ(of_world.size(), 1u) << "world " << w;
      phases.insert(*of_world.begin());
    }
    EXPECT_EQ(phases.size(), per_world ? kUpdate : 1u);
  }
}

TEST(Rate, HoldsBetweenSamples) {
  Bench bench(one(Rate(25)), 1);  // every fourth row at 100 Hz
  std::vector<float> out;
  for (int t = 0; t < 9; ++t) out.push_back(bench.feed(static_cast<float>(t), t));
  EXPECT_THAT(out, ElementsAre(0, 0, 0, 0, 4, 4, 4, 4, 8));
  Bench odd(one(Rate(30)), 1);  // 1 / 30 s is 3.33 rows: 3, 3 and 4 rows in turn, without drift
  int samples = 0;
  float last = -1;
  for (int t = 0; t < 100000; ++t) {
    const float x = odd.feed(static_cast<float>(t), t);
    samples += x != last;
    last = x;
  }
  EXPECT_EQ(samples, 30000);
  Bench phase(one(Rate(25, 0.02)), 1);
  out.clear();
  for (int t = 0; t < 7; ++t) out.push_back(phase.feed(static_cast<float>(t), t));
  EXPECT_THAT(out, ElementsAre(0, 0, 2, 2, 2, 2, 6));
}

TEST(Dropout, LosesTheGivenShareAndHolds) {
  Bench bench(one(Dropout(0.2)), 1);
  int lost = 0;
  float last = 0;
  for (int t = 0; t < 50000; ++t) {
    const float x = bench.feed(static_cast<float>(t), t);
    if (x != static_cast<float>(t)) {
      ++lost;
      ASSERT_EQ(x, last);
    }
    last = x;
  }
  EXPECT_NEAR(lost, 10000, 5 * std::sqrt(50000 * 0.16));
  Bench zero(one(Dropout(1.0, Dropout::Mode::kZero)), 1);
  EXPECT_EQ(zero.feed(3.0f, 0), 3.0f);
  EXPECT_EQ(zero.feed(3.0f, 1), 0.0f);
}

// ---- chain

TEST(Chain, HistoryIsOldestFirstAndBackfilled) {
  EffectChainCfg cfg;
  cfg.history_length = 3;
  Bench bench(cfg, 2);
  EXPECT_THAT(bench.feed_row({1, 2}, 0), ElementsAre(1, 2, 1, 2, 1, 2));
  EXPECT_THAT(bench.feed_row({3, 4}, 1), ElementsAre(1, 2, 1, 2, 3, 4));
  EXPECT_THAT(bench.feed_row({5, 6}, 1), ElementsAre(1, 2, 1, 2, 5, 6));
  bench.reset(2, 2);
  EXPECT_THAT(bench.feed_row({7, 8}, 2), ElementsAre(7, 8, 7, 8, 7, 8));
  EXPECT_THAT(bench.feed_row({9, 9}, 2),
              ElementsAre(9, 9, 9, 9, 9, 9));  // state written after the reset
}

TEST(Chain, MjlabsPipelineHasItsOrder) {
  PipelineCfg cfg;
  cfg.noise = Constant{{0.5}};
  cfg.bias = {0.25};
  cfg.episode_bias = EpisodeBias(Draw::constant({-0.25}));
  cfg.clip = {-1.0, 3.0};
  cfg.scale = {2.0};
  cfg.delay = StepDelay(1, 1);
  cfg.history_length = 2;
  Bench bench(pipeline(cfg), 1);
  EXPECT_THAT(bench.feed_row({0}, 0), ElementsAre(1, 1));
  EXPECT_THAT(bench.feed_row({1}, 1), ElementsAre(1, 1));
  EXPECT_THAT(bench.feed_row({9}, 2), ElementsAre(1, 3));
  EXPECT_THAT(bench.feed_row({0}, 3), ElementsAre(3, 6));

  cfg.enable_corruption = false;
  cfg.delay = {};
  cfg.history_length = 0;
  EXPECT_THAT(Bench(pipeline(cfg), 1).feed_row({1}, 0), ElementsAre(2));
  cfg.delay = StepDelay(2, 1);
  EXPECT_THROW(static_cast<void>(pipeline(cfg)), ValueError);
}

TEST(Chain, ErrorsNameSensorEffectAndValue) {
  const auto message = [](Effects effects, int size = 1) -> std::string {
    try {
      Bench bench(std::move(effects), size);
    } catch (const ValueError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(message(one(Noise(Draw::gaussian({1, 2}))), 3),
              HasSubstr("sensor 'test', effect 0 (noise): std has 2 values: must be 1, or 3"));
  EXPECT_THAT(message(one(Noise(Draw::gaussian({-1})))), HasSubstr("std is -1"));
  EXPECT_THAT(message(one(Clip({2}, {1}))), HasSubstr("low 2 is above high 1"));
  EXPECT_THAT(message(one(Rate(0))), HasSubstr("rate_hz is 0: must be above 0"));
  EXPECT_THAT(message(one(Dropout(1.5))), HasSubstr("probability is 1.5"));
  EXPECT_THAT(message(one(Misalignment()), 4), HasSubstr("3-vectors"));
  EXPECT_THAT(message(one(Delay(-1))), HasSubstr("delay_s is -1"));
  EXPECT_THAT(message(one(Delay(1e10))), HasSubstr("effect 0 (delay): the delay is"));
  EXPECT_THAT(message(one(StepDelay(0, std::numeric_limits<int>::max()))),
              HasSubstr("max_lag is 2147483647: must be at most 100000"));
}

// Integers have no NaN and are not clipped. They can be held or be zero.
TEST(Chain, EffectsThatComputeNeedRealNumbers) {
  SensorSpec spec;
  spec.dtype = DType::kInt32;
  spec.shape = {1};
  const auto chain = [&](Effects effects) {
    EffectChain("test", spec, EffectChainCfg{std::move(effects)}, 1, kPeriod, kPeriod);
  };
  for (const Effects& wrong : {one(Clip({0}, {1})), one(Dropout(0.1, Dropout::Mode::kNan)),
                               one(Noise(Draw::gaussian({1})))})
    EXPECT_THROW(chain(wrong), ValueError);
  EXPECT_NO_THROW(chain(one(Dropout(0.1, Dropout::Mode::kHold))));
  EXPECT_NO_THROW(chain(one(Dropout(0.1, Dropout::Mode::kZero))));
  EXPECT_NO_THROW(chain(one(Rate(10))));
}

TEST(EffectSensor, InvalidEffectsAreRefusedAtBuild) {
  const auto message = [](Effects effects) -> std::string {
    EffectSensorCfg cfg;
    cfg.name = "noisy";
    cfg.sensor = "clean";
    cfg.effects = std::move(effects);
    try {
      cfg.build();
    } catch (const ValueError& e) {
      return e.what();
    }
    return "";
  };
  const double nan = std::nan("");
  EXPECT_EQ(message(one(Dropout(0.5))), "");
  EXPECT_EQ(message(one(Dropout(2))),
            "sensor 'noisy': effects[0]: probability is 2: must be between 0 and 1");
  EXPECT_THAT(message({nullptr}), HasSubstr("effects[0] is null"));
  StepDelay lags(2, 1);
  BiasDrift drift;
  drift.std = {-1};
  Misalignment tilt;
  tilt.angle = {nan, 0, 0};
  for (const Effects& wrong :
       {one(Noise(Draw::gaussian({nan}))), one(Noise(Draw::uniform({1}, {0}))),
        one(Noise(Draw::constant({}))), one(EpisodeBias(Draw::gaussian({-1}))), one(drift),
        one(Scale({nan})), one(tilt), one(Clip({2}, {1})), one(Quantize({-1})), one(Delay(nan)),
        one(lags), one(Rate(nan)), one(Dropout(nan))}) {
    EXPECT_THAT(message(wrong), HasSubstr("sensor 'noisy': effects[0]"));
  }
}

TEST(Chain, DoesNotAllocate) {
  Delay d(0.03);
  d.jitter_s = 0.01;
  BiasDrift drift;
  drift.std = {1.0};
  drift.time_constant_s = 1;
  EffectChainCfg cfg;
  cfg.effects = {std::make_shared<Noise>(Draw::gaussian({1.0})),
                 std::make_shared<BiasDrift>(drift),
                 std::make_shared<EpisodeBias>(Draw::gaussian({1.0})),
                 std::make_shared<Misalignment>(),
                 std::make_shared<Quantize>(PerComponent{0.1}),
                 std::make_shared<Delay>(d),
                 std::make_shared<StepDelay>(0, 3),
                 std::make_shared<Rate>(33),
                 std::make_shared<Dropout>(0.1)};
  cfg.history_length = 4;
  SensorSpec spec;
  spec.shape = {3};
  EffectChain chain("x", spec, cfg, 2, kPeriod, kPeriod);
  std::vector<float> in = {1, 2, 3}, out(12);
  const AllocationCount count;
  for (int t = 0; t < 100; ++t) {
    if (t % 30 == 0) chain.reset({1, 1, 0, t, t});
    chain.apply({1, 1, 0, t, 1}, std::as_bytes(std::span(in)),
                std::as_writable_bytes(std::span(out)));
  }
  EXPECT_EQ(count.since(), 0);
}

}  // namespace
}  // namespace mjsense::effects
