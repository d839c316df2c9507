// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <type_traits>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/worlds/testing/plain_mujoco.h"

namespace mjsense::worlds {
namespace {

TEST(Worlds, ViewsHaveOneRowPerElement) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  EXPECT_EQ(worlds.state_component("xfrc_applied").shape, (Shape{2, m->nbody, 6}));
  EXPECT_EQ(worlds.state_component("qpos").shape, (Shape{2, m->nq}));
  const ModelPtr hand = compile_mjcf(kHand);
  Worlds hands(hand.get(), 3, 1);
  EXPECT_EQ(hands.state_component("mocap_pos").shape, (Shape{3, 1, 3}));
  EXPECT_EQ(hands.state_component("mocap_quat").shape, (Shape{3, 1, 4}));
  EXPECT_EQ(hands.state_component("userdata").shape, (Shape{3, 3}));
}

// Random numbers depend on the episode and the tick; both restart with the seed.
TEST(Worlds, ClocksCountEpisodesAndTicks) {
  struct Clock : Recording {
    using Recording::Recording;
    std::int64_t episode = -1, tick = -1, substep = -1;
    std::uint32_t key = 99;
    void refreshed(const World& w) override {
      if (w.id != 1) return;
      episode = w.episode;
      tick = w.tick;
      substep = w.substep;
      key = w.key;
    }
  };
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Clock hooks(2);
  worlds.reset(all_worlds, -1, hooks);
  EXPECT_EQ(hooks.episode, 1);
  worlds.step(3, hooks);
  worlds.reset(all_worlds, -1, hooks);
  EXPECT_EQ(hooks.episode, 2);
  EXPECT_EQ(hooks.tick, 3);  // random numbers never repeat
  EXPECT_EQ(hooks.substep, 0);
  worlds.step_raw(4);
  worlds.visit(all_worlds, hooks);
  EXPECT_EQ(hooks.tick, 7);
  EXPECT_EQ(hooks.substep, 4);
  EXPECT_DOUBLE_EQ(worlds.time(1), 4 * 0.004);
  worlds.seed(5);
  worlds.visit(all_worlds, hooks);
  EXPECT_EQ(hooks.episode, 0);
  EXPECT_EQ(hooks.tick, 0);
  EXPECT_EQ(hooks.key, 1u);
  worlds.rekey(1, 17);
  worlds.reset(all_worlds, -1, hooks);
  EXPECT_EQ(hooks.episode, 1);
  EXPECT_EQ(hooks.key, 17u);
}

TEST(Worlds, ResetAffectsOnlyTheSelection) {
  const ModelPtr m = load("implicitfast");
  Worlds worlds(m.get(), 4, 2);
  Recording hooks(4);
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(10, hooks);
  const std::vector<double> before = hooks.sensordata[1];
  const int ids[] = {3, 0};
  worlds.reset(ids, 0, hooks);
  EXPECT_THAT(hooks.resets, ::testing::ElementsAre(2, 1, 1, 2));
  EXPECT_EQ(worlds.substeps(0), 0);
  EXPECT_EQ(worlds.substeps(1), 10);
  EXPECT_EQ(hooks.sensordata[1], before);
  const int bad[] = {1, 1}, far[] = {4};
  EXPECT_THROW(worlds.reset(bad, -1, hooks), ValueError);
  EXPECT_THROW(worlds.reset(far, -1, hooks), ValueError);
  EXPECT_THROW(worlds.reset(all_worlds, 7, hooks), ValueError);
}

TEST(Worlds, EmptyListSelectsNoWorld) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(2, hooks);
  const std::vector<int> resets = hooks.resets, refreshes = hooks.refreshes, none;
  worlds.step(5, hooks, none);
  worlds.reset(none, 0, hooks);
  worlds.forward(none, hooks);
  worlds.visit(none, hooks);
  EXPECT_EQ(hooks.resets, resets);
  EXPECT_EQ(hooks.refreshes, refreshes);
  EXPECT_EQ(worlds.substeps(1), 2);
  EXPECT_TRUE(worlds.checked_ids(none).empty());
  EXPECT_THAT(worlds.checked_ids(all_worlds), ::testing::ElementsAre(0, 1, 2));
  EXPECT_THAT(worlds.checked_ids(std::vector<int>{2, 0}), ::testing::ElementsAre(0, 2));
  static_assert(!std::is_default_constructible_v<WorldIds>, "{} would not say which worlds");
}

TEST(Worlds, RejectsInvalidArguments) {
  const ModelPtr m = load("Euler");
  EXPECT_THROW(Worlds(m.get(), 0, 1), ValueError);
  EXPECT_THROW(Worlds(m.get(), 1, -2), ValueError);
  Worlds worlds(m.get(), 1, 1);
  EXPECT_THROW(worlds.state_component("qpoz"), KeyError);
}

// A held box stays in the air, bit for bit, however the world is stepped; a reset lets it go.
TEST(Hold, KeepsABodyInPlaceUntilTheReset) {
  for (const char* integrator : {"Euler", "RK4", "implicitfast"}) {
    const ModelPtr m = load(integrator);
    const int joint[] = {static_cast<int>(m->njnt) - 1}, hinge[] = {0};
    Worlds worlds(m.get(), 2, 1);
    Recording hooks(2);
    const auto box = [&](int world) {
      const double *qpos = state_row(worlds, "qpos", world),
                   *qvel = state_row(worlds, "qvel", world);
      std::vector<double> state(qpos + 2, qpos + 9);
      state.insert(state.end(), qvel + 2, qvel + 8);
      return state;
    };
    for (const bool every : {false, true}) {
      worlds.reset(all_worlds, -1, hooks);
      hooks.every = every;
      hooks.read = every ? mjSTAGE_ACC : mjSTAGE_NONE;
      const std::vector<double> start = box(0);
      worlds.hold(0, joint);
      for (int k = 0; k < 5; ++k) worlds.step(10, hooks);
      EXPECT_EQ(box(0), start) << integrator;
      EXPECT_LT(box(1)[2], start[2] - 0.05) << "the other world's box falls";
      worlds.step_raw(3);
      EXPECT_EQ(box(0), start) << integrator;
      worlds.reset(all_worlds, -1, hooks);
      worlds.step(20, hooks);
      EXPECT_EQ(box(0), box(1));
    }
    EXPECT_THROW(worlds.hold(0, hinge), ValueError);
  }
}

}  // namespace
}  // namespace mjsense::worlds
