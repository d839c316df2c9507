// SPDX-License-Identifier: Apache-2.0
// Samples starts of many episodes and plays none of them: no object may start inside another.
#include <gtest/gtest.h>

#include <numeric>

#include "mjsense/rollout/rollout.h"

namespace mjsense::rollout {
namespace {

constexpr int kWorlds = 8;

// Faults of the first `episodes` starts.
std::vector<std::string> faults(const char* task, const char* scene, int episodes) {
  RolloutCfg cfg;
  cfg.task = task;
  cfg.scene = scene;
  cfg.policy = "";
  cfg.num_worlds = kWorlds;
  cfg.cameras.emplace();
  Rollout rollout(cfg);
  std::vector<int> worlds(kWorlds);
  std::iota(worlds.begin(), worlds.end(), 0);
  std::vector<std::int64_t> numbers(kWorlds);
  std::vector<std::string> found;
  for (int first = 0; first < episodes; first += kWorlds) {
    std::iota(numbers.begin(), numbers.end(), first);
    rollout.start(worlds, numbers);
    for (int w : worlds) {
      if (!rollout.fault(w).empty())
        found.push_back(std::to_string(first + w) + ": " + rollout.fault(w));
    }
  }
  return found;
}

// Two large plates next to the object to be moved fit only if all three are drawn again together.
TEST(Starts, ObjectsDoNotOverlap) {
  EXPECT_EQ(faults("pick_and_place_color", "", 112), std::vector<std::string>());
}

}  // namespace
}  // namespace mjsense::rollout
