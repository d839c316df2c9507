#include "mjsense/worlds/worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <type_traits>
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
    worlds.reset(all_worlds, -1, hooks);
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
  worlds.reset(all_worlds, 0, hooks);
  DataPtr d(mj_makeData(m.get()), mj_deleteData);
  mj_resetDataKeyframe(m.get(), d.get(), 0);
  const ArrayView qpos = worlds.state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[0] = d->qpos[0] = -1.2;
  for (int s = 0; s < 3; ++s) mj_step(m.get(), d.get());
  worlds.step(3, hooks);  // no forward() in between: the step must not reuse the old stages
  EXPECT_EQ(std::memcmp(qpos.data + qpos.strides[0], d->qpos, m->nq * sizeof(double)), 0);
}

TEST(Worlds, ResetOnlyTheOnesNamed) {
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

TEST(Worlds, AnEmptyListIsNoWorld) {
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

TEST(Worlds, OneThatDivergesIsNamedAndResetAlone) {
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
