// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/chain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/allocations.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/pipeline.h"
#include "mjsense/effects/testing/bench.h"
#include "mjsense/effects/timing.h"

namespace mjsense::effects {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

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
    return error_of<ValueError>([&] { Bench bench(std::move(effects), size); });
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
