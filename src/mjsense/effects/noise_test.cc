// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "mjsense/effects/testing/bench.h"

namespace mjsense::effects {
namespace {

using ::testing::ElementsAre;

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

}  // namespace
}  // namespace mjsense::effects
