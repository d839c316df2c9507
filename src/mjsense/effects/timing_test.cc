// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/timing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "mjsense/effects/calibration.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/testing/bench.h"

namespace mjsense::effects {
namespace {

using ::testing::ElementsAre;

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

}  // namespace
}  // namespace mjsense::effects
