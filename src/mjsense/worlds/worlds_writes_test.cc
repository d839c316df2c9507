// SPDX-License-Identifier: Apache-2.0
// Whatever part of the state or the model is written between steps, the next step uses it.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "mjsense/worlds/testing/plain_mujoco.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

// A write between two steps, applied in the same manner to a plain mjData and to a world.
struct Write {
  const char* component;
  mjtState bit;
  int index;
  double value;
};

constexpr Write kWrites[] = {
    {"userdata", mjSTATE_USERDATA, 0, 0.0},  // changes nothing
    {"time", mjSTATE_TIME, 0, 7.0},
    {"qpos", mjSTATE_QPOS, 1, 0.7},
    {"qvel", mjSTATE_QVEL, 0, -2.0},
    {"act", mjSTATE_ACT, 0, 0.4},
    {"ctrl", mjSTATE_CTRL, 0, 0.8},
    {"qfrc_applied", mjSTATE_QFRC_APPLIED, 1, 3.0},
    {"xfrc_applied", mjSTATE_XFRC_APPLIED, 6 * 4 + 2, 5.0},
    {"mocap_pos", mjSTATE_MOCAP_POS, 0, 1.1},
    {"mocap_quat", mjSTATE_MOCAP_QUAT, 3, 0.3},
    {"eq_active", mjSTATE_EQ_ACTIVE, 0, 1.0},
    {"userdata", mjSTATE_USERDATA, 1, 2.5},
    {"qacc_warmstart", mjSTATE_WARMSTART, 2, 40.0},
};

void write_both(Worlds& worlds, int world, const mjModel* m, mjData* d, const Write& write) {
  state_row(worlds, write.component, world)[write.index] = write.value;
  std::vector<mjtNum> values(mj_stateSize(m, write.bit));
  mj_getState(m, d, values.data(), write.bit);
  values.at(write.index) = write.value;
  mj_setState(m, d, values.data(), write.bit);
}

class Writes : public ::testing::TestWithParam<std::tuple<const char*, Write>> {};

// A step after the state was written through the views, without forward(), must equal mj_step from
// that state, regardless of earlier reads and of reads between the write and the step.
TEST_P(Writes, AffectTheNextStep) {
  const auto [integrator, write] = GetParam();
  const ModelPtr m = load(integrator);
  for (const int decimation : {1, 4}) {
    for (const mjtStage read : {mjSTAGE_NONE, mjSTAGE_VEL, mjSTAGE_ACC}) {
      for (const mjtStage look : {mjSTAGE_NONE, mjSTAGE_VEL, mjSTAGE_ACC}) {
        Worlds worlds(m.get(), 2, 2);
        Recording hooks(2);
        worlds.reset(all_worlds, 0, hooks);
        const DataPtr plain = make_data(m.get());
        mj_resetDataKeyframe(m.get(), plain.get(), 0);
        for (int k = 0; k < 12; ++k) {
          if (k >= 8 && k < 10) {
            write_both(worlds, 1, m.get(), plain.get(), write);
            hooks.read = look;
            worlds.visit(all_worlds, hooks);
          }
          hooks.read = read;
          worlds.step(decimation, hooks);
          for (int s = 0; s < decimation; ++s) mj_step(m.get(), plain.get());
          expect_same_state(worlds, 1, m.get(), plain.get());
          if (HasFatalFailure())
            FAIL() << write.component << ", decimation " << decimation << ", read " << read
                   << ", look " << look << ", step " << k;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, Writes,
                         ::testing::Combine(::testing::Values("Euler", "implicit", "implicitfast",
                                                              "RK4"),
                                            ::testing::ValuesIn(kWrites)),
                         [](const auto& info) {
                           const Write& write = std::get<1>(info.param);
                           return fmt::format("{}_{}_{}", std::get<0>(info.param), write.component,
                                              write.index);
                         });

// A value of a model field in one world affects every stage from the next step on.
TEST(Worlds, NextStepUsesAChangedModel) {
  for (const char* integrator : {"Euler", "implicitfast"}) {
    const ModelPtr m = load(integrator), heavy = load(integrator);
    for (int b = 1; b < heavy->nbody; ++b) heavy->body_mass[b] *= 3;
    for (const mjtStage read : {mjSTAGE_NONE, mjSTAGE_VEL, mjSTAGE_ACC}) {
      Worlds worlds(m.get(), 2, 1);
      Recording hooks(2);
      hooks.read = read;
      worlds.reset(all_worlds, 0, hooks);
      worlds.step(3, hooks);
      const DataPtr plain = make_data(m.get());
      mj_resetDataKeyframe(m.get(), plain.get(), 0);
      for (int s = 0; s < 3; ++s) mj_step(m.get(), plain.get());
      auto* mass = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "body_mass", nullptr, nullptr));
      std::copy_n(heavy->body_mass, heavy->nbody, mass + heavy->nbody);
      worlds.model_changed();
      worlds.step(1, hooks);
      mj_step(heavy.get(), plain.get());
      expect_same_state(worlds, 1, m.get(), plain.get());
      EXPECT_NE(state_row(worlds, "qpos", 0)[0], plain->qpos[0]) << "has the masses of the model";
    }
  }
}

// The same writes to a hand without joints, whose pose moves other bodies by contact and by a weld.
TEST(Worlds, MocapBodiesAndConstraintsMayBeWrittenBetweenSteps) {
  const ModelPtr m = compile_mjcf(kHand);
  const double turn = std::sqrt(0.5);
  const Write writes[] = {
      {"mocap_pos", mjSTATE_MOCAP_POS, 0, -0.195},
      {"mocap_pos", mjSTATE_MOCAP_POS, 2, 0.4},
      {"mocap_quat", mjSTATE_MOCAP_QUAT, 0, turn},
      {"mocap_quat", mjSTATE_MOCAP_QUAT, 3, turn},
      {"qvel", mjSTATE_QVEL, 1, 0.7},
      {"qfrc_applied", mjSTATE_QFRC_APPLIED, 2, 5},
      {"xfrc_applied", mjSTATE_XFRC_APPLIED, 12, 3},
      {"qpos", mjSTATE_QPOS, 2, 0.5},
      {"userdata", mjSTATE_USERDATA, 1, 42},
      {"eq_active", mjSTATE_EQ_ACTIVE, 0, 0},
  };
  for (const Write& write : writes) {
    Worlds worlds(m.get(), 2, 1);
    Recording hooks(2);
    worlds.reset(all_worlds, -1, hooks);
    const DataPtr d(mj_makeData(m.get()));
    for (int s = 0; s < 6; ++s) mj_step(m.get(), d.get());
    worlds.step(6, hooks);
    write_both(worlds, 1, m.get(), d.get(), write);
    worlds.step(5, hooks);
    for (int s = 0; s < 5; ++s) mj_step(m.get(), d.get());
    SCOPED_TRACE(write.component);
    expect_same_state(worlds, 1, m.get(), d.get());
    mj_forward(m.get(), d.get());
    hooks.expect_fresh(1, m.get(), d.get());
  }
}

// Hooks must see user data as it was written.
TEST(Worlds, HooksReadUserData) {
  const ModelPtr m = compile_mjcf(kHand);
  struct Reader : Recording {
    using Recording::Recording;
    std::vector<double> seen;
    void refreshed(const World& w) override {
      seen.assign(w.data->userdata, w.data->userdata + w.model->nuserdata);
    }
  };
  Worlds worlds(m.get(), 1, 1);
  Reader hooks(1);
  worlds.reset(all_worlds, -1, hooks);
  double* data = state_row(worlds, "userdata", 0);
  data[1] = 7;
  worlds.step(2, hooks);
  EXPECT_THAT(hooks.seen, ::testing::ElementsAre(0, 7, 0));
  data[2] = 8;
  worlds.visit(all_worlds, hooks);
  EXPECT_THAT(hooks.seen, ::testing::ElementsAre(0, 7, 8));
}

// State written between calls must be current at the next visit, without step or forward().
TEST(Worlds, VisitUsesWrittenState) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  const DataPtr d(mj_makeData(m.get()));
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  state_row(worlds, "qpos", 1)[1] = d->qpos[1] = 0.9;
  mj_forward(m.get(), d.get());
  worlds.visit(all_worlds, hooks);
  hooks.expect_fresh(1, m.get(), d.get());
}

TEST(Worlds, ModelOfAWorldHasItsValues) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 1);
  int size = 0;
  auto* mass = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "body_mass", &size, nullptr));
  mass[2 * size + 1] = 7;
  const mjModel second = worlds.model_of(1), third = worlds.model_of(2);
  EXPECT_EQ(second.body_mass[1], worlds.model()->body_mass[1]);
  EXPECT_EQ(third.body_mass[1], 7);
  EXPECT_EQ(third.body_pos, worlds.model()->body_pos) << "not copied";

  const ModelPtr copy(mj_copyModel(nullptr, worlds.model()));
  worlds.write_model(2, copy.get());
  EXPECT_EQ(copy->body_mass[1], 7);
  worlds.write_model(1, copy.get());
  EXPECT_EQ(copy->body_mass[1], worlds.model()->body_mass[1]);
  EXPECT_EQ(copy->body_mass[2], worlds.model()->body_mass[2]);
  auto* gravity = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "opt.gravity", nullptr, nullptr));
  gravity[5] = -1;
  worlds.write_model(1, copy.get());
  EXPECT_EQ(copy->opt.gravity[2], -1);
}

}  // namespace
}  // namespace mjsense::worlds
