// SPDX-License-Identifier: Apache-2.0
// Steps give the states of plain MuJoCo, and what is read belongs to them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "mjsense/worlds/testing/plain_mujoco.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

class Integrators : public ::testing::TestWithParam<std::tuple<const char*, bool, int>> {};

// Split and reused stages must give the same states as mj_step bit for bit, and the same sensors as
// mj_forward, regardless of what is read and when.
TEST_P(Integrators, EqualTheNaiveLoop) {
  const auto [integrator, every, decimation] = GetParam();
  const ModelPtr m = load(integrator);
  constexpr int kWorlds = 3, kSteps = 60;
  constexpr mjtStage kRead[] = {mjSTAGE_ACC, mjSTAGE_NONE, mjSTAGE_VEL, mjSTAGE_NONE,
                                mjSTAGE_ACC, mjSTAGE_ACC,  mjSTAGE_POS};
  for (int threads : {1, 2, 5}) {
    Worlds worlds(m.get(), kWorlds, threads);
    Recording hooks(kWorlds);
    hooks.every = every;
    worlds.reset(all_worlds, -1, hooks);
    std::vector<DataPtr> naive;
    naive.reserve(kWorlds);
    for (int w = 0; w < kWorlds; ++w) naive.push_back(make_data(m.get()));
    const DataPtr fresh = make_data(m.get());
    for (int k = 0; k < kSteps; ++k) {
      const int drawn = k / 3;  // controls that are constant for a while allow a solve to be reused
      drive(worlds, drawn);
      hooks.read = kRead[k % 7];
      hooks.read_every = kRead[k % 5];
      worlds.step(decimation, hooks);
      ASSERT_TRUE(worlds.failures().empty());
      for (int w = 0; w < kWorlds; ++w) {
        naive[w]->ctrl[0] = std::sin(0.3 * drawn + w);
        naive[w]->ctrl[1] = 0.2 * w;
        for (int s = 0; s < decimation; ++s) mj_step(m.get(), naive[w].get());
        expect_same_state(worlds, w, m.get(), naive[w].get());
        mj_copyData(fresh.get(), m.get(), naive[w].get());
        mj_forward(m.get(), fresh.get());
        hooks.expect_fresh(w, m.get(), fresh.get());
        if (HasFatalFailure()) FAIL() << "step " << k << ", threads " << threads;
      }
    }
    EXPECT_EQ(hooks.substeps[1], every ? kSteps * decimation : 0);
    EXPECT_DOUBLE_EQ(worlds.time(2), kSteps * decimation * 0.004);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Integrators,
                         ::testing::Combine(::testing::Values("Euler", "implicit", "implicitfast",
                                                              "RK4", "discrete"),
                                            ::testing::Bool(), ::testing::Values(1, 4)));

// MuJoCo's own histories and delays take a sample of their sensor at every physics step.
TEST(Worlds, HistoriesEqualTheNaiveLoop) {
  const ModelPtr m = compile_mjcf(R"(<mujoco><option timestep="0.004"/><worldbody><body>
    <joint name="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".04"/><site name="tip" pos=".4 0 0"/>
    </body></worldbody><sensor><jointpos joint="hinge" nsample="4"/><accelerometer site="tip" nsample="5" delay=".008"/></sensor></mujoco>)");
  ASSERT_GT(m->nhistory, 0);
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, -1, hooks);
  const DataPtr d = make_data(m.get());
  for (int k = 0; k < 10; ++k) {
    worlds.step(3, hooks);
    for (int s = 0; s < 3; ++s) mj_step(m.get(), d.get());
    expect_same_state(worlds, 0, m.get(), d.get());
  }
}

// If forces are first read after new controls were written, they must belong to the controls of the
// last step, and the next step must use the new ones.
TEST(Worlds, LateReadsUseTheControlsOfTheStep) {
  const ModelPtr m = load("implicitfast");
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, 0, hooks);
  const DataPtr plain = make_data(m.get()), fresh = make_data(m.get());
  mj_resetDataKeyframe(m.get(), plain.get(), 0);
  for (int k = 0; k < 20; ++k) {
    plain->ctrl[0] = state_row(worlds, "ctrl", 0)[0] = std::sin(0.5 * k);
    hooks.read = mjSTAGE_NONE;
    worlds.step(2, hooks);
    for (int s = 0; s < 2; ++s) mj_step(m.get(), plain.get());
    state_row(worlds, "ctrl", 0)[0] = 100.0;  // for the next step, which uses other controls
    for (const mjtStage read : {mjSTAGE_VEL, mjSTAGE_ACC}) {
      hooks.read = read;
      worlds.visit(all_worlds, hooks);
      mj_copyData(fresh.get(), m.get(), plain.get());
      mj_forward(m.get(), fresh.get());
      hooks.expect_fresh(0, m.get(), fresh.get());
    }
    EXPECT_EQ(state_row(worlds, "ctrl", 0)[0], 100.0);
    state_row(worlds, "ctrl", 0)[0] = plain->ctrl[0];
    expect_same_state(worlds, 0, m.get(), plain.get());
  }
}

// Number of computations of positions, velocities and the constraint solve in 10 control steps.
std::array<int, 3> computed_in_steps(const char* integrator, mjtStage read, int decimation,
                                     bool changing_controls, bool every = false,
                                     mjtStage read_every = mjSTAGE_ACC) {
  const ModelPtr m = load(integrator);
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  hooks.every = every;
  hooks.read = read;
  hooks.read_every = read_every;
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(decimation, hooks);
  const std::array<int, 3> before = hooks.computed[0];
  for (int k = 0; k < 10; ++k) {
    if (changing_controls) drive(worlds, k + 1);
    worlds.step(decimation, hooks);
    worlds.visit(all_worlds, hooks);  // everything is up to date
  }
  std::array<int, 3> counts;
  for (int i = 0; i < 3; ++i) counts[i] = hooks.computed[0][i] - before[i];
  return counts;
}

TEST(Worlds, StagesAreComputedOnceAndOnlyIfRead) {
  using ::testing::ElementsAre;
  for (const char* integrator : {"Euler", "implicit", "implicitfast"}) {
    for (const int n : {1, 4}) {
      const int steps = 10 * n;
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_NONE, n, true),
                  ElementsAre(steps, steps, steps));
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_VEL, n, true),
                  ElementsAre(steps, steps, steps));
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_ACC, n, true),
                  ElementsAre(steps, steps, steps + 10));
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_ACC, n, false),
                  ElementsAre(steps, steps, steps));
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_ACC, n, true, true),
                  ElementsAre(steps, steps, steps + 10));
      EXPECT_THAT(computed_in_steps(integrator, mjSTAGE_NONE, n, true, true, mjSTAGE_POS),
                  ElementsAre(steps, steps, steps));
    }
  }
  // Four evaluations per step.
  EXPECT_THAT(computed_in_steps("RK4", mjSTAGE_VEL, 1, true), ElementsAre(40, 40, 40));
}

// With <flag energy="enable"/>, mj_forward fills e_kinetic before it computes the energy.
TEST(Worlds, EnergySensorsAreFresh) {
  const char* xml = R"(<mujoco><option><flag energy="enable"/></option><worldbody>
    <body pos="0 0 1"><joint axis="1 0 0"/><geom size=".1" pos="0 .3 0"/></body></worldbody>
    <sensor><e_kinetic/><e_potential/></sensor></mujoco>)";
  const ModelPtr m = compile_mjcf(xml);
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, -1, hooks);
  const DataPtr d = make_data(m.get());
  const auto expect = [&](const char* when) {
    d->qpos[0] = state_row(worlds, "qpos", 1)[0];
    d->qvel[0] = state_row(worlds, "qvel", 1)[0];
    mj_forward(m.get(), d.get());
    mj_energyPos(m.get(), d.get());
    mj_energyVel(m.get(), d.get());
    ASSERT_GT(d->energy[1], 1.0);
    EXPECT_EQ(hooks.sensordata[1][0], d->energy[1]) << when;
    EXPECT_EQ(hooks.sensordata[1][1], d->energy[0]) << when;
  };
  state_row(worlds, "qvel", 1)[0] = 3;
  worlds.forward(all_worlds, hooks);
  expect("after forward");
  worlds.step(1, hooks);
  expect("after a step");
  worlds.step(3, hooks);
  expect("after three");
  state_row(worlds, "qvel", 1)[0] = 4;
  worlds.visit(all_worlds, hooks);
  expect("at a visit");
}

// step_raw() is mj_step and nothing else. Fields read after it are as mj_step left them, one step
// behind the state, until the next step.
TEST(Worlds, RawStepsLeaveFieldsOneSubstepBehind) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, 0, hooks);
  const DataPtr d = make_data(m.get());
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  mj_forward(m.get(), d.get());
  worlds.step_raw(5);
  worlds.visit(all_worlds, hooks);
  for (int k = 0; k < 5; ++k) mj_step(m.get(), d.get());
  hooks.expect_fresh(0, m.get(), d.get());
  const std::vector<double> behind = hooks.sensordata[0];
  const DataPtr fresh = make_data(m.get());
  mj_copyData(fresh.get(), m.get(), d.get());
  mj_forward(m.get(), fresh.get());
  EXPECT_NE(behind, std::vector<double>(fresh->sensordata, fresh->sensordata + m->nsensordata));
  worlds.step(1, hooks);
  mj_step(m.get(), d.get());
  expect_same_state(worlds, 0, m.get(), d.get());
  mj_forward(m.get(), d.get());
  hooks.expect_fresh(0, m.get(), d.get());
}

// Controllers are called before physics steps 0, n, 2n ... and see the current state. Results of
// old controls or poses must not be reused, regardless of earlier reads.
TEST(Worlds, ControllersEqualTheNaiveLoop) {
  struct Controller : WorldHooks {
    mjtStage reads = mjSTAGE_NONE;
    std::vector<int> indices;
    mjtStage stage() const override { return reads; }
    void substep(const World& /*world*/) override {}
    void reset(const World& /*world*/) override {}
    void refreshed(const World& /*world*/) override {}
    int control_every() const override { return 3; }
    static void act(const mjModel* m, mjData* d) {
      for (int i = 0; i < m->nu; ++i) d->ctrl[i] = 0.3 * std::sin(3 * d->qpos[0] + i) - d->qvel[0];
      for (int i = 0; i < m->nmocap; ++i) d->mocap_pos[3 * i] += 0.001;
    }
    mjtStage control(const World& world, int index) override {
      indices.push_back(index);
      act(world.model, world.data);
      return world.model->nmocap > 0 ? mjSTAGE_NONE : mjSTAGE_VEL;
    }
  };
  for (const bool hand : {false, true}) {
    const ModelPtr m = hand ? compile_mjcf(kHand) : load("Euler");
    Worlds worlds(m.get(), 1, 1);
    Controller hooks;
    worlds.reset(all_worlds, -1, hooks);
    const DataPtr d = make_data(m.get());
    mj_resetData(m.get(), d.get());
    for (const mjtStage reads : {mjSTAGE_NONE, mjSTAGE_ACC, mjSTAGE_VEL, mjSTAGE_ACC}) {
      hooks.reads = reads;
      hooks.indices.clear();
      worlds.step(8, hooks);
      EXPECT_EQ(hooks.indices, (std::vector<int>{0, 1, 2}));
      for (int k = 0; k < 8; ++k) {
        if (k % 3 == 0) Controller::act(m.get(), d.get());
        mj_step(m.get(), d.get());
      }
      expect_same_state(worlds, 0, m.get(), d.get());
    }
  }
}

// Forces must belong to the state at every substep, not only at the last one.
TEST(Worlds, SubstepHookReadsFreshForces) {
  struct Forces : Recording {
    using Recording::Recording;
    std::vector<double> seen;
    void substep(const World& w) override {
      seen.insert(seen.end(), w.data->sensordata, w.data->sensordata + w.model->nsensordata);
    }
  };
  const ModelPtr m = load("implicitfast");
  Worlds worlds(m.get(), 1, 1);
  Forces hooks(1);
  hooks.every = true;
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(8, hooks);
  const DataPtr d(mj_makeData(m.get()));
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  std::vector<double> want;
  const DataPtr fresh(mj_makeData(m.get()));
  for (int s = 0; s < 8; ++s) {
    mj_step(m.get(), d.get());
    mj_copyData(fresh.get(), m.get(), d.get());
    mj_forward(m.get(), fresh.get());
    want.insert(want.end(), fresh->sensordata, fresh->sensordata + m->nsensordata);
  }
  EXPECT_EQ(hooks.seen, want);
}

}  // namespace
}  // namespace mjsense::worlds
