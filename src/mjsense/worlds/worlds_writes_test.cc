// SPDX-License-Identifier: Apache-2.0
// Whatever part of the state or the model is written between steps, the next step uses it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mjsense/worlds/testing/plain_mujoco.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

// A write between two steps, applied in the same manner to a plain mjData and to a world.
struct Write {
  const char* name;
  const char* component;
  int index;
  double value;
};

constexpr Write kWrites[] = {
    {"nothing", "userdata", 0, 0.0},
    {"time", "time", 0, 7.0},
    {"qpos", "qpos", 1, 0.7},
    {"qvel", "qvel", 0, -2.0},
    {"act", "act", 0, 0.4},
    {"ctrl", "ctrl", 0, 0.8},
    {"qfrc_applied", "qfrc_applied", 1, 3.0},
    {"xfrc_applied", "xfrc_applied", 6 * 4 + 2, 5.0},
    {"mocap_pos", "mocap_pos", 0, 1.1},
    {"mocap_quat", "mocap_quat", 3, 0.3},
    {"eq_active", "eq_active", 0, 1.0},
    {"userdata", "userdata", 1, 2.5},
    {"qacc_warmstart", "qacc_warmstart", 2, 40.0},
};

void write_plain(const mjModel* m, mjData* d, const Write& write) {
  const auto whole = [&](int bit) {
    std::vector<mjtNum> values(mj_stateSize(m, bit));
    mj_getState(m, d, values.data(), bit);
    values.at(write.index) = write.value;
    mj_setState(m, d, values.data(), bit);
  };
  const std::map<std::string_view, int> bits = {{"time", mjSTATE_TIME},
                                                {"qpos", mjSTATE_QPOS},
                                                {"qvel", mjSTATE_QVEL},
                                                {"act", mjSTATE_ACT},
                                                {"ctrl", mjSTATE_CTRL},
                                                {"qfrc_applied", mjSTATE_QFRC_APPLIED},
                                                {"xfrc_applied", mjSTATE_XFRC_APPLIED},
                                                {"mocap_pos", mjSTATE_MOCAP_POS},
                                                {"mocap_quat", mjSTATE_MOCAP_QUAT},
                                                {"eq_active", mjSTATE_EQ_ACTIVE},
                                                {"userdata", mjSTATE_USERDATA},
                                                {"qacc_warmstart", mjSTATE_WARMSTART}};
  whole(bits.at(write.component));
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
            write_plain(m.get(), plain.get(), write);
            state_row(worlds, write.component, 1)[write.index] = write.value;
            hooks.read = look;
            worlds.visit(all_worlds, hooks);
          }
          hooks.read = read;
          worlds.step(decimation, hooks);
          for (int s = 0; s < decimation; ++s) mj_step(m.get(), plain.get());
          expect_same_state(worlds, 1, m.get(), plain.get());
          if (HasFatalFailure())
            FAIL() << write.name << ", decimation " << decimation << ", read " << read << ", look "
                   << look << ", step " << k;
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
                           return std::string(std::get<0>(info.param)) + "_" +
                                  std::get<1>(info.param).name;
                         });

TEST(Worlds, NextStepUsesAChangedModel) {
  const ModelPtr m = load("Euler"), heavy = load("Euler");
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
  }
}

TEST(Worlds, StepUsesStateWrittenThroughViews) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  DataPtr d(mj_makeData(m.get()));
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[0] = d->qpos[0] = -1.2;
  for (int s = 0; s < 3; ++s) mj_step(m.get(), d.get());
  worlds.step(3, hooks);  // without forward() in between: the step must not reuse old stages
  EXPECT_EQ(std::memcmp(qpos.data + qpos.strides[0], d->qpos, m->nq * sizeof(double)), 0);
}

// Whatever part of the state is written between two steps, the next step must equal that of an
// mjData with the same write.
TEST(Worlds, EveryPartOfTheStateMayBeWrittenBetweenSteps) {
  const ModelPtr m = compile_mjcf(kHand);
  struct Write {
    const char* component;
    mjtNum* mjData::*field;
    int index;
    double value;
  };
  const double turn = std::sqrt(0.5);
  const Write writes[] = {
      {"mocap_pos", &mjData::mocap_pos, 0, -0.195},
      {"mocap_pos", &mjData::mocap_pos, 2, 0.4},
      {"mocap_quat", &mjData::mocap_quat, 0, turn},
      {"mocap_quat", &mjData::mocap_quat, 3, turn},
      {"qvel", &mjData::qvel, 1, 0.7},
      {"qfrc_applied", &mjData::qfrc_applied, 2, 5},
      {"xfrc_applied", &mjData::xfrc_applied, 12, 3},
      {"qpos", &mjData::qpos, 2, 0.5},
      {"userdata", &mjData::userdata, 1, 42},
  };
  for (const Write& write : writes) {
    Worlds worlds(m.get(), 2, 1);
    Recording hooks(2);
    worlds.reset(all_worlds, -1, hooks);
    const DataPtr d(mj_makeData(m.get()));
    for (int s = 0; s < 6; ++s) mj_step(m.get(), d.get());
    worlds.step(6, hooks);
    const std::vector<double> untouched = hooks.sensordata[0];

    const ArrayView view = worlds.state_component(write.component);
    reinterpret_cast<double*>(view.data + view.strides[0])[write.index] = write.value;
    (d.get()->*write.field)[write.index] = write.value;
    worlds.step(5, hooks);
    for (int s = 0; s < 5; ++s) mj_step(m.get(), d.get());
    for (const char* part : {"qpos", "qvel", "mocap_pos", "mocap_quat", "userdata"}) {
      const ArrayView v = worlds.state_component(part);
      const std::string_view name = part;
      const mjtNum* want = name == "qpos"        ? d->qpos
                           : name == "qvel"      ? d->qvel
                           : name == "mocap_pos" ? d->mocap_pos
                           : name == "userdata"  ? d->userdata
                                                 : d->mocap_quat;
      std::size_t n = 1;
      for (int k = 1; k < v.shape.rank(); ++k) n *= v.shape[k];
      EXPECT_EQ(std::memcmp(v.data + v.strides[0], want, n * sizeof(double)), 0)
          << part << " after a write to " << write.component;
    }
    mj_forward(m.get(), d.get());
    for (int i = 0; i < m->nsensordata; ++i)
      EXPECT_EQ(hooks.sensordata[1][i], d->sensordata[i]) << write.component;
  }
}

// eq_active is stored as bytes in mjData and as numbers in a state row, so it is written by a
// separate function.
TEST(Worlds, ConstraintMayBeDisabledBetweenSteps) {
  const ModelPtr m = compile_mjcf(kHand);
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, -1, hooks);
  const DataPtr d(mj_makeData(m.get()));
  for (int s = 0; s < 6; ++s) mj_step(m.get(), d.get());
  worlds.step(6, hooks);
  *reinterpret_cast<double*>(worlds.state_component("eq_active").data) = 0;
  d->eq_active[0] = 0;
  worlds.step(5, hooks);
  for (int s = 0; s < 5; ++s) mj_step(m.get(), d.get());
  const auto* qpos = reinterpret_cast<const double*>(worlds.state_component("qpos").data);
  EXPECT_EQ(std::memcmp(qpos, d->qpos, m->nq * sizeof(double)), 0);
  EXPECT_LT(qpos[9], 0.3 - 1e-4);  // the box falls
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
  auto* data = reinterpret_cast<double*>(worlds.state_component("userdata").data);
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
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[1] = d->qpos[1] = 0.9;
  mj_forward(m.get(), d.get());
  worlds.visit(all_worlds, hooks);
  for (int i = 0; i < m->nsensordata; ++i) EXPECT_EQ(hooks.sensordata[1][i], d->sensordata[i]);
}

// A world's value of a model field must affect every stage from the next step on.
TEST(Worlds, ModelFieldMayChangeBetweenSteps) {
  const ModelPtr m = load("implicitfast");
  const ModelPtr heavy = load("implicitfast");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  int size = 0;
  auto* mass = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "body_mass", &size, nullptr));
  ASSERT_EQ(size, m->nbody);
  const DataPtr d(mj_makeData(m.get()));
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  worlds.step(4, hooks);
  for (int s = 0; s < 4; ++s) mj_step(m.get(), d.get());
  mass[size + 2] = heavy->body_mass[2] = 3.5;  // of world 1
  worlds.model_changed();
  worlds.step(4, hooks);
  for (int s = 0; s < 4; ++s) mj_step(heavy.get(), d.get());
  const ArrayView qpos = worlds.state_component("qpos");
  EXPECT_EQ(std::memcmp(qpos.data + qpos.strides[0], d->qpos, m->nq * sizeof(double)), 0);
  EXPECT_NE(std::memcmp(qpos.data, d->qpos, m->nq * sizeof(double)), 0);
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
