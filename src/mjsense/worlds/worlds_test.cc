#include "mjsense/worlds/worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

using ModelPtr = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
using DataPtr = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

// A hand that drops a box on a plane: contacts, an actuator, every sensor stage.
constexpr char kXml[] = R"(
<mujoco>
  <option timestep="0.004" integrator="%s"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1"/>
    <body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0" damping=".1"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/>
      <body pos=".4 0 0"><joint name="elbow" axis="0 1 0"/><geom type="box" size=".1 .1 .1" mass=".5"/>
        <site name="tip"/></body></body>
    <body name="box" pos="1 0 .2"><freejoint/><geom type="box" size=".1 .1 .1" mass=".3"/></body>
  </worldbody>
  <actuator><motor name="m" joint="hinge" gear="4"/><position joint="elbow" kp="20"/></actuator>
  <sensor><accelerometer site="tip"/><velocimeter site="tip"/><framepos objtype="site" objname="tip"/></sensor>
  <keyframe><key name="up" qpos="0.5 0.3 1 0 .5 1 0 0 0"/></keyframe>
</mujoco>)";

ModelPtr load(const char* integrator) {
  char xml[4096], error[512] = "";
  std::snprintf(xml, sizeof xml, kXml, integrator);
  mjSpec* spec = mj_parseXMLString(xml, nullptr, error, sizeof error);
  EXPECT_NE(spec, nullptr) << error;
  ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  return m;
}

struct Recording : WorldHooks {
  bool every = false;
  std::vector<std::vector<double>> sensordata;  // by world, as last refreshed
  std::vector<int> substeps, resets, refreshes;
  std::vector<double> force;
  int throw_in = -1;
  explicit Recording(int n) : sensordata(n), substeps(n), resets(n), refreshes(n), force(n) {}
  bool wants_substep() const override { return every; }
  void substep(const World& w) override { ++substeps[w.id]; }
  void reset(const World& w) override { ++resets[w.id]; }
  void refreshed(const World& w) override {
    ++refreshes[w.id];
    sensordata[w.id].assign(w.data->sensordata, w.data->sensordata + w.model->nsensordata);
    force[w.id] = w.data->nefc > 0 ? w.data->efc_force[0] : 0;
    if (w.id == throw_in) throw ValueError("hook failed");
  }
};

void drive(Worlds& worlds, int step) {
  const ArrayView ctrl = worlds.state_component("ctrl");
  for (int w = 0; w < worlds.size(); ++w) {
    auto* row = reinterpret_cast<double*>(ctrl.data + w * ctrl.strides[0]);
    row[0] = std::sin(0.3 * step + w);
    row[1] = 0.2 * w;
  }
}

class Integrators : public ::testing::TestWithParam<std::tuple<const char*, bool>> {};

// Taken apart and reused, the stages give the states of plain mj_step bit for bit, and the sensors
// of mj_forward there.
TEST_P(Integrators, EqualTheNaiveLoopBitForBitAndAreFresh) {
  const auto [integrator, every] = GetParam();
  const ModelPtr m = load(integrator);
  constexpr int kWorlds = 3, kSteps = 60, kDecimation = 4;
  std::vector<double> states;
  for (int threads : {1, 2, 5}) {
    Worlds worlds(m.get(), kWorlds, threads);
    Recording hooks(kWorlds);
    hooks.every = every;
    worlds.reset({}, -1, hooks);
    std::vector<DataPtr> naive;
    for (int w = 0; w < kWorlds; ++w) naive.emplace_back(mj_makeData(m.get()), mj_deleteData);
    DataPtr fresh(mj_makeData(m.get()), mj_deleteData);
    for (int k = 0; k < kSteps; ++k) {
      drive(worlds, k);
      for (int w = 0; w < kWorlds; ++w) {
        naive[w]->ctrl[0] = std::sin(0.3 * k + w);
        naive[w]->ctrl[1] = 0.2 * w;
        for (int s = 0; s < kDecimation; ++s) mj_step(m.get(), naive[w].get());
      }
      worlds.step(kDecimation, hooks);
      ASSERT_TRUE(worlds.failures().empty());
      for (int w = 0; w < kWorlds; ++w) {
        const ArrayView qpos = worlds.state_component("qpos");
        ASSERT_EQ(
            std::memcmp(qpos.data + w * qpos.strides[0], naive[w]->qpos, m->nq * sizeof(double)), 0)
            << "world " << w << " step " << k;
        mj_copyData(fresh.get(), m.get(), naive[w].get());
        mj_forward(m.get(), fresh.get());
        for (int i = 0; i < m->nsensordata; ++i)
          ASSERT_EQ(hooks.sensordata[w][i], fresh->sensordata[i]);
        ASSERT_EQ(hooks.force[w], fresh->nefc > 0 ? fresh->efc_force[0] : 0.0);
      }
    }
    EXPECT_EQ(hooks.substeps[1], every ? kSteps * kDecimation : 0);
    EXPECT_DOUBLE_EQ(worlds.time(2), kSteps * kDecimation * 0.004);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Integrators,
                         ::testing::Combine(::testing::Values("Euler", "implicit", "implicitfast",
                                                              "RK4"),
                                            ::testing::Bool()));

TEST(Worlds, SeeStateWrittenThroughTheViews) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset({}, 0, hooks);
  DataPtr d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[0] = d->qpos[0] = -1.2;
  for (int s = 0; s < 3; ++s) mj_step(m.get(), d.get());
  worlds.step(3, hooks);  // no forward() in between: the step must not reuse the old stages
  EXPECT_EQ(std::memcmp(qpos.data + qpos.strides[0], d->qpos, m->nq * sizeof(double)), 0);
}

// A hand without a joint: a mocap body that pushes a box by contact and pulls another by a weld.
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

// Whatever part of the state is written between two steps, the next step is that of a mjData in which
// the same was written.
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
    worlds.reset({}, -1, hooks);
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

// eq_active is bytes in mjData and numbers in a row: it is written by its own.
TEST(Worlds, AConstraintMayBeReleasedBetweenSteps) {
  char error[512] = "";
  mjSpec* spec = mj_parseXMLString(kHand, nullptr, error, sizeof error);
  ASSERT_NE(spec, nullptr) << error;
  const ModelPtr m(mj_compile(spec, nullptr), mj_deleteModel);
  mj_deleteSpec(spec);
  Worlds worlds(m.get(), 1, 1);
  Recording hooks(1);
  worlds.reset({}, -1, hooks);
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
  for (int s = 0; s < 6; ++s) mj_step(m.get(), d.get());
  worlds.step(6, hooks);
  *reinterpret_cast<double*>(worlds.state_component("eq_active").data) = 0;
  d->eq_active[0] = 0;
  worlds.step(5, hooks);
  for (int s = 0; s < 5; ++s) mj_step(m.get(), d.get());
  const auto* qpos = reinterpret_cast<const double*>(worlds.state_component("qpos").data);
  EXPECT_EQ(std::memcmp(qpos, d->qpos, m->nq * sizeof(double)), 0);
  EXPECT_LT(qpos[9], 0.3 - 1e-4);  // it falls
}

// What a hook sees of the user's own numbers is what was written.
TEST(Worlds, UserDataArriveInMjData) {
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
  worlds.reset({}, -1, hooks);
  auto* data = reinterpret_cast<double*>(worlds.state_component("userdata").data);
  data[1] = 7;
  worlds.step(2, hooks);
  EXPECT_THAT(hooks.seen, ::testing::ElementsAre(0, 7, 0));
  data[2] = 8;
  worlds.visit({}, hooks);
  EXPECT_THAT(hooks.seen, ::testing::ElementsAre(0, 7, 8));
}

// What is written between calls is current at the next look, without a step or a forward().
TEST(Worlds, AVisitMakesWrittenStateCurrent) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset({}, 0, hooks);
  const DataPtr d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[1] = d->qpos[1] = 0.9;
  mj_forward(m.get(), d.get());
  worlds.visit({}, hooks);
  for (int i = 0; i < m->nsensordata; ++i) EXPECT_EQ(hooks.sensordata[1][i], d->sensordata[i]);
}

// A world's own value of a model field counts from the next step on, in every stage of it.
TEST(Worlds, AModelFieldMayChangeBetweenSteps) {
  const ModelPtr m = load("implicitfast");
  const ModelPtr heavy = load("implicitfast");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset({}, 0, hooks);
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

TEST(Worlds, ViewsHaveARowAnElement) {
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

// A control that is no number: MuJoCo would go on with zeros.
TEST(Worlds, AControlThatIsNoNumberIsAFailure) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 2, 1);
  Recording hooks(2);
  worlds.reset({}, 0, hooks);
  const ArrayView ctrl = worlds.state_component("ctrl");
  *reinterpret_cast<double*>(ctrl.data) = std::numeric_limits<double>::quiet_NaN();
  worlds.step(1, hooks);
  ASSERT_EQ(worlds.failures().size(), 1u);
  EXPECT_EQ(worlds.failures()[0].world, 0);
  EXPECT_THAT(worlds.failures()[0].message, ::testing::HasSubstr("CTRL"));
}

// Random numbers depend on the episode and the step; both begin again with the seed.
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
  worlds.reset({}, -1, hooks);
  EXPECT_EQ(hooks.episode, 1);
  worlds.step(3, hooks);
  worlds.reset({}, -1, hooks);
  EXPECT_EQ(hooks.episode, 2);
  EXPECT_EQ(hooks.tick, 3);  // never the same numbers twice
  EXPECT_EQ(hooks.substep, 0);
  worlds.step_raw(4);
  worlds.visit({}, hooks);
  EXPECT_EQ(hooks.tick, 7);
  EXPECT_EQ(hooks.substep, 4);
  EXPECT_DOUBLE_EQ(worlds.time(1), 4 * 0.004);
  worlds.seed(5);
  worlds.visit({}, hooks);
  EXPECT_EQ(hooks.episode, 0);
  EXPECT_EQ(hooks.tick, 0);
  EXPECT_EQ(hooks.key, 1u);
  worlds.rekey(1, 17);
  worlds.reset({}, -1, hooks);
  EXPECT_EQ(hooks.episode, 1);
  EXPECT_EQ(hooks.key, 17u);
}

// Forces belong to the state at every substep, not at the last one alone.
TEST(Worlds, ASubstepHookSeesFreshForces) {
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
  worlds.reset({}, 0, hooks);
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

TEST(Worlds, ResetOnlyTheOnesNamed) {
  const ModelPtr m = load("implicitfast");
  Worlds worlds(m.get(), 4, 2);
  Recording hooks(4);
  worlds.reset({}, 0, hooks);
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
  EXPECT_THROW(worlds.reset({}, 7, hooks), ValueError);
}

TEST(Worlds, OneThatDivergesIsNamedAndResetAlone) {
  const ModelPtr m = load("Euler");
  Worlds worlds(m.get(), 3, 2);
  Recording hooks(3);
  worlds.reset({}, 0, hooks);
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

TEST(Worlds, AFailingHookLeavesTheOthersAndTheSimulationUsable) {
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

TEST(Worlds, RejectsNonsense) {
  const ModelPtr m = load("Euler");
  EXPECT_THROW(Worlds(m.get(), 0, 1), ValueError);
  EXPECT_THROW(Worlds(m.get(), 1, -2), ValueError);
  Worlds worlds(m.get(), 1, 1);
  EXPECT_THROW(worlds.state_component("qpoz"), KeyError);
}

}  // namespace
}  // namespace mjsense
