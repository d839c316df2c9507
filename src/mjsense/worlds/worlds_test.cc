// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense::worlds {
namespace {

using ModelPtr = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
using DataPtr = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

// A hand that drops a box on a plane: contacts, actuators with and without activation, an equality
// constraint that can be disabled, a mocap body in the box's path, and sensors of every stage.
constexpr char kXml[] = R"(
<mujoco>
  <option timestep="0.004" integrator="%s"/>
  <size nuserdata="2"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1"/>
    <body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0" damping=".1"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/>
      <body pos=".4 0 0"><joint name="elbow" axis="0 1 0"/><geom type="box" size=".1 .1 .1" mass=".5"/>
        <site name="tip"/></body></body>
    <body name="post" mocap="true" pos="1.15 0 .1"><geom type="box" size=".02 .1 .1"/></body>
    <body name="box" pos="1 0 .2"><freejoint/><geom type="box" size=".1 .1 .1" mass=".3"/></body>
  </worldbody>
  <actuator><motor name="m" joint="hinge" gear="4"/><position joint="elbow" kp="20"/>
    <general name="slow" joint="elbow" dyntype="filter" dynprm=".1" gainprm="2"/></actuator>
  <equality><joint joint1="hinge" joint2="elbow" active="false"/></equality>
  <sensor><accelerometer site="tip"/><velocimeter site="tip"/><framepos objtype="site" objname="tip"/></sensor>
  <keyframe><key name="up" qpos="0.5 0.3 1 0 .5 1 0 0 0"/></keyframe>
</mujoco>)";

ModelPtr load_text(const char* xml) {
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(xml, nullptr, error, sizeof error);
  EXPECT_NE(spec, nullptr) << error;
  ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  return m;
}

ModelPtr load(const char* integrator) {
  char xml[4096];
  std::snprintf(xml, sizeof xml, kXml, integrator);
  return load_text(xml);
}

struct Recording : WorldHooks {
  bool every = false;
  mjtStage read = mjSTAGE_ACC, read_every = mjSTAGE_ACC;
  std::vector<std::vector<double>> sensordata;  // by world, at the last refreshed()
  std::vector<int> substeps, resets, refreshes;
  std::vector<double> force;
  // How often positions, velocities and the constraint solve were computed.
  std::vector<std::array<int, 3>> computed;
  int throw_in = -1;
  explicit Recording(int n)
      : sensordata(n), substeps(n), resets(n), refreshes(n), force(n), computed(n) {}
  mjtStage stage() const override { return read; }
  mjtStage substep_stage() const override { return read_every; }
  bool wants_substep() const override { return every; }
  void substep(const World& w) override { ++substeps[w.id]; }
  void reset(const World& w) override { ++resets[w.id]; }
  void refreshed(const World& w) override {
    ++refreshes[w.id];
    sensordata[w.id].assign(w.data->sensordata, w.data->sensordata + w.model->nsensordata);
    force[w.id] = w.data->nefc > 0 ? w.data->efc_force[0] : 0;
    const mjTimerStat* timer = w.data->timer;
    computed[w.id] = {timer[mjTIMER_POSITION].number, timer[mjTIMER_VELOCITY].number,
                      timer[mjTIMER_CONSTRAINT].number};
    if (w.id == throw_in) throw ValueError("hook failed");
  }
  // Sensors of the requested stages and the first force must equal those of mj_forward.
  void expect_fresh(int w, const mjModel* m, const mjData* d) const {
    for (int i = 0; i < m->nsensor; ++i) {
      if (m->sensor_needstage[i] > read) continue;
      for (int k = 0; k < m->sensor_dim[i]; ++k) {
        ASSERT_EQ(sensordata[w][m->sensor_adr[i] + k], d->sensordata[m->sensor_adr[i] + k])
            << "sensor " << i << " of stage " << m->sensor_needstage[i];
      }
    }
    if (read == mjSTAGE_ACC) {
      ASSERT_EQ(force[w], d->nefc > 0 ? d->efc_force[0] : 0.0);
    }
  }
};

DataPtr make_data(const mjModel* m) { return DataPtr(mj_makeData(m), mj_deleteData); }

// Compares the complete state row, warm start included.
void expect_same_state(Worlds& worlds, int w, const mjModel* m, const mjData* d) {
  std::vector<mjtNum> row(mj_stateSize(m, mjSTATE_INTEGRATION));
  mj_getState(m, d, row.data(), mjSTATE_INTEGRATION);
  const ArrayView state = worlds.state();
  ASSERT_EQ(std::memcmp(state.data + w * state.strides[0], row.data(), row.size() * sizeof(mjtNum)),
            0)
      << "world " << w;
}

double* state_row(Worlds& worlds, const char* component, int w) {
  const ArrayView view = worlds.state_component(component);
  return reinterpret_cast<double*>(view.data + w * view.strides[0]);
}

void drive(Worlds& worlds, int step) {
  const ArrayView ctrl = worlds.state_component("ctrl");
  for (int w = 0; w < worlds.size(); ++w) {
    auto* row = reinterpret_cast<double*>(ctrl.data + w * ctrl.strides[0]);
    row[0] = std::sin(0.3 * step + w);
    row[1] = 0.2 * w;
  }
}

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

// MuJoCo's own histories and delays take a sample of their sensor at every physics step.
TEST(Worlds, HistoriesEqualTheNaiveLoop) {
  const ModelPtr m = load_text(R"(<mujoco><option timestep="0.004"/><worldbody><body>
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

INSTANTIATE_TEST_SUITE_P(All, Integrators,
                         ::testing::Combine(::testing::Values("Euler", "implicit", "implicitfast",
                                                              "RK4", "discrete"),
                                            ::testing::Bool(), ::testing::Values(1, 4)));

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

TEST(Worlds, StepUsesStateWrittenThroughViews) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  DataPtr d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[0] = d->qpos[0] = -1.2;
  for (int s = 0; s < 3; ++s) mj_step(m.get(), d.get());
  worlds.step(3, hooks);  // without forward() in between: the step must not reuse old stages
  EXPECT_EQ(std::memcmp(qpos.data + qpos.strides[0], d->qpos, m->nq * sizeof(double)), 0);
}

// A hand without joints: a mocap body that pushes one box by contact and pulls another by a weld.
constexpr char kHand[] = R"(
<mujoco>
  <size nuserdata="3"/><option timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1"/>
    <body name="hand" mocap="true" pos="-.35 0 .1"><geom type="box" size=".1 .1 .1"/></body>
    <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass=".3"/></body>
    <body name="pulled" pos="-.35 1 .3"><freejoint/><geom size=".05" mass=".1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <equality><weld name="pull" body1="hand" body2="pulled"/></equality>
  <sensor><framepos objtype="body" objname="hand"/><framequat objtype="body" objname="hand"/></sensor>
</mujoco>)";

// Whatever part of the state is written between two steps, the next step must equal that of an
// mjData with the same write.
TEST(Worlds, EveryPartOfTheStateMayBeWrittenBetweenSteps) {
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
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
    const DataPtr d(mj_makeData(m.get()), mj_deleteData);
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
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset(all_worlds, -1, hooks);
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
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
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
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
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
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
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
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

  const ModelPtr copy(mj_copyModel(nullptr, worlds.model()), mj_deleteModel);
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

// With <flag energy="enable"/>, mj_forward fills e_kinetic before it computes the energy.
TEST(Worlds, EnergySensorsAreFresh) {
  const char* xml = R"(<mujoco><option><flag energy="enable"/></option><worldbody>
    <body pos="0 0 1"><joint axis="1 0 0"/><geom size=".1" pos="0 .3 0"/></body></worldbody>
    <sensor><e_kinetic/><e_potential/></sensor></mujoco>)";
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(xml, nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
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

// Six boxes in an arena that is too small for their contacts warn at every substep; MuJoCo's
// handler is called once.
TEST(Worlds, WarningsAreCountedPerWorldAndReportedOnce) {
  std::string xml = "<mujoco><size memory='12K'/><worldbody><geom type='plane' size='5 5 .1'/>";
  for (int i = 0; i < 6; ++i)
    xml += "<body pos='" + std::to_string(.05 * i) +
           " 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'/></body>";
  char error[512] = "";
  mjSpec* spec =
      mj_parseXMLString((xml + "</worldbody></mujoco>").c_str(), nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
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

TEST(Worlds, ViewsHaveOneRowPerElement) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  EXPECT_EQ(worlds.state_component("xfrc_applied").shape, (Shape{2, m->nbody, 6}));
  EXPECT_EQ(worlds.state_component("qpos").shape, (Shape{2, m->nq}));
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
  const ModelPtr hand(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  Worlds hands(hand.get(), 3, 1);
  EXPECT_EQ(hands.state_component("mocap_pos").shape, (Shape{3, 1, 3}));
  EXPECT_EQ(hands.state_component("mocap_quat").shape, (Shape{3, 1, 4}));
  EXPECT_EQ(hands.state_component("userdata").shape, (Shape{3, 3}));
}

// A control that is NaN: MuJoCo would continue with zeros.
TEST(Worlds, NanControlIsAFailure) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset(all_worlds, 0, hooks);
  const ArrayView ctrl = worlds.state_component("ctrl");
  *reinterpret_cast<double*>(ctrl.data) = std::numeric_limits<double>::quiet_NaN();
  worlds.step(1, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_EQ(worlds.failures()[0].world, 0);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("CTRL"));
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
    char error[512] = "";
    ModelPtr m = load("Euler");
    if (hand) {
      mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
      ASSERT_TRUE(spec) << error;
      m.reset(mj_compile(spec, nullptr));
      mj_deleteSpec(spec);
    }
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
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  std::vector<double> want;
  const DataPtr fresh(mj_makeData(m.get()), mj_deleteData);
  for (int s = 0; s < 8; ++s) {
    mj_step(m.get(), d.get());
    mj_copyData(fresh.get(), m.get(), d.get());
    mj_forward(m.get(), fresh.get());
    want.insert(want.end(), fresh->sensordata, fresh->sensordata + m->nsensordata);
  }
  EXPECT_EQ(hooks.seen, want);
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

TEST(Worlds, OnlyADivergingWorldIsReset) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  worlds.reset(all_worlds, 0, hooks);
  worlds.step(5, hooks);
  const ArrayView qvel = worlds.state_component("qvel");
  reinterpret_cast<double*>(qvel.data + qvel.strides[0])[0] =
      std::numeric_limits<double>::quiet_NaN();
  worlds.step(5, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_EQ(worlds.failures()[0].world, 1);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("QVEL"));
  EXPECT_EQ(worlds.substeps(1), 0);
  EXPECT_EQ(worlds.substeps(2), 10);
  const ArrayView qpos = worlds.state_component("qpos");
  EXPECT_EQ(reinterpret_cast<double*>(qpos.data + qpos.strides[0])[0],
            0.5);  // the keyframe of its last reset
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
  const ModelPtr m = load_text(R"(<mujoco><worldbody>
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
  const ModelPtr m = load_text(R"(<mujoco><worldbody>
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
  try {
    worlds.step(1, hooks, std::vector<int>{1});
    FAIL() << "no world of the call is left";
  } catch (const RuntimeError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("world 1 fails even after a reset"));
  }
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
      const ArrayView qpos = worlds.state_component("qpos"), qvel = worlds.state_component("qvel");
      const auto row = [&](const ArrayView& view) {
        return reinterpret_cast<const double*>(reinterpret_cast<const char*>(view.data) +
                                               world * view.strides[0]);
      };
      std::vector<double> state(row(qpos) + 2, row(qpos) + 9);
      state.insert(state.end(), row(qvel) + 2, row(qvel) + 8);
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
