// SPDX-License-Identifier: Apache-2.0
// Failures are reported, and do not affect other worlds.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/worlds/testing/plain_mujoco.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

// Six boxes in an arena that is too small for their contacts warn at every substep; MuJoCo's
// handler is called once.
TEST(Worlds, WarningsAreCountedPerWorldAndReportedOnce) {
  std::string xml = "<mujoco><size memory='12K'/><worldbody><geom type='plane' size='5 5 .1'/>";
  for (int i = 0; i < 6; ++i)
    xml += "<body pos='" + std::to_string(.05 * i) +
           " 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'/></body>";
  const ModelPtr m = compile_mjcf(xml + "</worldbody></mujoco>");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  static std::vector<std::string>* heard = nullptr;
  std::vector<std::string> messages;
  heard = &messages;
  const auto before = mju_user_warning;
  mju_user_warning = [](const char* text) { heard->emplace_back(text); };
  // Except in world 1, the boxes are far from each other.
  for (int w = 0; w < 3; w += 2) {
    for (int i = 0; i < 6; ++i) state_row(worlds, "qpos", w)[7 * i] = 3 * i;
    for (int i = 0; i < 6; ++i) state_row(worlds, "qpos", w)[7 * i + 2] = 9;
  }
  worlds.step(4, hooks);
  const auto full = [&](int w) { return worlds.warning_counts(w)[mjWARN_CONTACTFULL]; };
  EXPECT_EQ(full(0), 0);
  EXPECT_GE(full(1), 4);
  const std::int64_t first = full(1);
  const int one[] = {1};
  for (int i = 0; i < 3; ++i) {
    worlds.reset(one, -1, hooks);
    worlds.step(1, hooks);
  }
  mju_user_warning = before;
  EXPECT_GE(full(1), first + 6);
  EXPECT_EQ(full(2), 0);
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_THAT(messages[0], ::testing::HasSubstr("Too many contacts"));
  EXPECT_THAT(messages[0], ::testing::HasSubstr("world 1"));
}

// A control that is NaN: MuJoCo would continue with zeros.
TEST(Worlds, NanControlIsAFailure) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  state_row(worlds, "ctrl", 0)[0] = std::numeric_limits<double>::quiet_NaN();
  worlds.step(1, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_EQ(worlds.failures()[0].world, 0);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("CTRL"));
}

TEST(Worlds, OnlyADivergingWorldIsReset) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(5, hooks);
  state_row(worlds, "qvel", 1)[0] = std::numeric_limits<double>::quiet_NaN();
  worlds.step(5, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_EQ(worlds.failures()[0].world, 1);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("QVEL"));
  EXPECT_EQ(worlds.substeps(1), 0);
  EXPECT_EQ(worlds.substeps(2), 10);
  EXPECT_EQ(state_row(worlds, "qpos", 1)[0], 0.5);  // the keyframe of its last reset
  worlds.step(5, hooks);
  EXPECT_TRUE(worlds.failures().empty());
}

// A failing step must be reported by that step, even if nothing is read.
TEST(Worlds, DivergenceIsReportedWithoutReads) {
  const ModelPtr m = load("Euler");
  for (const mjtStage read : {mjSTAGE_NONE, mjSTAGE_ACC}) {
    Worlds worlds(m.get(), 2, 1);
    Recording hooks(2);
    hooks.read = read;
    worlds.reset(all_worlds, 0, hooks);
    state_row(worlds, "qpos", 1)[4] = 9.99e9;  // height of the box; MuJoCo's limit is 1e10
    state_row(worlds, "qvel", 1)[4] = 9.9e9;
    worlds.step(1, hooks);
    ASSERT_EQ(worlds.failures().size(), 1u);
    EXPECT_EQ(worlds.failures()[0].world, 1);
    EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("QPOS"));
    worlds.step(1, hooks);
    EXPECT_TRUE(worlds.failures().empty());
  }
}

// MuJoCo itself checks neither mocap poses nor the time.
TEST(Worlds, StepReportsAnyBadState) {
  const ModelPtr m = compile_mjcf(R"(<mujoco><worldbody>
    <body name="hand" mocap="true"><geom size=".1" contype="0" conaffinity="0"/></body>
    <body pos="0 0 1"><freejoint/><geom size=".1"/></body>
    </worldbody></mujoco>)");
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const char* name : {"time", "mocap_pos", "mocap_quat", "qpos", "qvel", "xfrc_applied"}) {
      Worlds worlds(m.get(), 2, 1);
      Recording hooks(2);
      worlds.reset(all_worlds, -1, hooks);
      state_row(worlds, name, 1)[0] = bad;
      worlds.step(2, hooks);
      ASSERT_EQ(worlds.failures().size(), 1u) << name;
      EXPECT_EQ(worlds.failures()[0].world, 1);
      worlds.step(1, hooks);
      EXPECT_TRUE(worlds.failures().empty()) << name << ": the reset repairs it";
      EXPECT_EQ(worlds.substeps(0), 3);
    }
  }
}

// A read that computes forces from a bad control must report it at once, and the next step must be
// unaffected.
TEST(Worlds, ReadingReportsABadControl) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, 0, hooks);
  state_row(worlds, "ctrl", 0)[0] = std::numeric_limits<double>::quiet_NaN();
  worlds.forward(all_worlds, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("(ctrl)"));
  worlds.step(1, hooks);
  EXPECT_TRUE(worlds.failures().empty());
}

// MuJoCo's errors jump out of the call. The mjData that is shared by the worlds of a thread must be
// usable afterwards.
TEST(Worlds, MuJoCoErrorDoesNotAffectOtherWorlds) {
  const ModelPtr m = load("implicitfast");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  hooks.read = mjSTAGE_NONE;
  auto* solver = static_cast<int*>(mjb_expand(worlds.batch(), "opt.solver", nullptr, nullptr));
  ASSERT_NE(solver, nullptr);
  solver[0] = 99;  // detected when the box touches the floor
  worlds.model_changed();
  worlds.reset(all_worlds, -1, hooks);
  const DataPtr plain = make_data(m.get());
  int failed = 0;
  for (int k = 0; k < 120; ++k) {
    worlds.step(1, hooks);
    mj_step(m.get(), plain.get());
    expect_same_state(worlds, 1, m.get(), plain.get());
    for (const Failure& failure : worlds.failures()) {
      EXPECT_EQ(failure.world, 0);
      EXPECT_THAT(failure.message, ::testing::HasSubstr("solver"));
      EXPECT_EQ(worlds.substeps(0), 0);
      ++failed;
    }
  }
  EXPECT_GT(failed, 1);
  EXPECT_LT(failed, 10);
}

// MuJoCo raises an error in a world whose floor has no normal, also when that world is reset.
TEST(Worlds, WorldThatFailsEvenWhenResetDoesNotAffectOtherWorlds) {
  const ModelPtr m = compile_mjcf(R"(<mujoco><worldbody>
    <geom name="floor" type="plane" size="1 1 .1" pos="0 0 .001" euler="1 0 0"/>
    <body pos="0 0 .09"><freejoint/><geom type="sphere" size=".1"/></body>
    </worldbody></mujoco>)");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  worlds.reset(all_worlds, -1, hooks);
  auto* quat = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "geom_quat", nullptr, nullptr));
  std::fill_n(quat + 4 * m->ngeom, 4, 0.0);  // of the floor of world 1
  worlds.model_changed();
  const DataPtr plain = make_data(m.get());
  for (int k = 1; k <= 3; ++k) {
    worlds.step(1, hooks);
    mj_step(m.get(), plain.get());
    for (int w : {0, 2}) expect_same_state(worlds, w, m.get(), plain.get());
    ASSERT_EQ(worlds.failures().size(), 1u);
    EXPECT_EQ(worlds.failures()[0].world, 1);
    EXPECT_THAT(worlds.failures()[0].message,
                ::testing::AllOf(::testing::HasSubstr("fails even after a reset"),
                                 ::testing::HasSubstr("contact frame")));
    worlds.visit(all_worlds, hooks);  // reading does not throw
  }
  worlds.forward(all_worlds, hooks);
  EXPECT_EQ(worlds.failures().size(), 1u);
  worlds.reset(all_worlds, -1, hooks);
  EXPECT_EQ(worlds.failures().size(), 1u);
  EXPECT_THAT(error_of<RuntimeError>([&] { worlds.step(1, hooks, std::vector<int>{1}); }),
              ::testing::HasSubstr("world 1 fails even after a reset"));
  quat[4 * m->ngeom] = 1;
  worlds.model_changed();
  const int resets = hooks.resets[1];
  worlds.step(1, hooks);
  EXPECT_TRUE(worlds.failures().empty());
  EXPECT_EQ(hooks.resets[1], resets + 1) << "the world begins a new episode";
  EXPECT_EQ(worlds.substeps(1), 1);
}

TEST(Worlds, FailingHookDoesNotAffectOtherWorlds) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  hooks.throw_in = 1;
  EXPECT_THROW(worlds.step(1, hooks), ValueError);
  EXPECT_EQ(hooks.refreshes[2], 1);
  hooks.throw_in = -1;
  worlds.step(1, hooks);
  EXPECT_EQ(worlds.substeps(1), 2);
}

}  // namespace
}  // namespace mjsense::worlds
