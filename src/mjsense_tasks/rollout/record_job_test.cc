// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/record_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "mjsense/core/error.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::tasks::rollout {
namespace {

using ::testing::HasSubstr;

RecordJobCfg shard(const std::string& name, int attempts) {
  RecordJobCfg job;
  job.out = "data";
  job.shard = name;
  job.num_attempts = attempts;
  return without_shard(job);
}

// Each attempt belongs to exactly one shard.
TEST(Shard, ShardsDivideTheAttempts) {
  for (const auto& [attempts, n] : {std::pair{10, 3}, {8, 8}, {7, 1}}) {
    int next = 0;
    for (int k = 0; k < n; ++k) {
      const RecordJobCfg job = shard(std::to_string(k) + "/" + std::to_string(n), attempts);
      EXPECT_EQ(job.first_attempt, next);
      EXPECT_GE(job.num_attempts, attempts / n);
      EXPECT_LE(job.num_attempts, attempts / n + 1);
      EXPECT_EQ(job.out, std::filesystem::path("data") / ("shard_" + std::to_string(k)));
      EXPECT_EQ(without_shard(job).out, job.out);
      next += job.num_attempts;
    }
    EXPECT_EQ(next, attempts);
  }
  RecordJobCfg later;
  later.first_attempt = 100;
  later.num_attempts = 4;
  later.shard = "1/2";
  EXPECT_EQ(without_shard(later).first_attempt, 102);
}

TEST(Shard, InvalidShardsAreRefused) {
  for (const char* name : {"3/3", "-1/3", "1", "1/", "/3", "1/3x", "a/b", "1/0"})
    EXPECT_THAT(error_of([&] { shard(name, 9); }), HasSubstr("expected k/n with k from 0")) << name;
  RecordJobCfg far;
  far.first_attempt = 2'000'000'000;
  far.num_attempts = 200'000'000;
  EXPECT_THAT(error_of([&] { without_shard(far); }),
              HasSubstr("first_attempt + num_attempts is 2200000000, the maximum is 2147483647"));
  EXPECT_THAT(error_of([&] { shard("0/3", 2); }),
              HasSubstr("num_attempts is 2; it is the number of attempts of all shards"));
}

// House 0 has the random numbers of its seed, and every other house has others.
TEST(SeedOfHouse, HousesHaveTheirOwnRandomNumbers) {
  std::set<std::uint64_t> seeds;
  for (const std::uint64_t seed : {0, 1}) {
    EXPECT_EQ(seed_of_house(seed, 0), seed);
    for (int house = 0; house < 100; ++house) seeds.insert(seed_of_house(seed, house));
  }
  EXPECT_EQ(seeds.size(), 200u);
}

}  // namespace
}  // namespace mjsense::tasks::rollout
