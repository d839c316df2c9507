// SPDX-License-Identifier: Apache-2.0
#pragma once
// Helpers for tests that compare worlds with plain MuJoCo: models, hooks that record what they see, and
// states.

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/test_model.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

// A hand that drops a box on a plane: contacts, actuators with and without activation, an equality
// constraint that can be disabled, a mocap body in the box's path, and sensors of every stage.
inline constexpr char kArmAndBox[] = R"(
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

inline ModelPtr load(const char* integrator) {
  char xml[4096];
  std::snprintf(xml, sizeof xml, kArmAndBox, integrator);
  return compile_mjcf(xml);
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

// Compares the complete state row, warm start included.
inline void expect_same_state(Worlds& worlds, int w, const mjModel* m, const mjData* d) {
  std::vector<mjtNum> row(mj_stateSize(m, mjSTATE_INTEGRATION));
  mj_getState(m, d, row.data(), mjSTATE_INTEGRATION);
  const ArrayView state = worlds.state();
  ASSERT_EQ(std::memcmp(state.data + w * state.strides[0], row.data(), row.size() * sizeof(mjtNum)),
            0)
      << "world " << w;
}

inline double* state_row(Worlds& worlds, const char* component, int w) {
  const ArrayView view = worlds.state_component(component);
  return reinterpret_cast<double*>(view.data + w * view.strides[0]);
}

inline void drive(Worlds& worlds, int step) {
  for (int w = 0; w < worlds.size(); ++w) {
    double* row = state_row(worlds, "ctrl", w);
    row[0] = std::sin(0.3 * step + w);
    row[1] = 0.2 * w;
  }
}

// A hand without joints: a mocap body that pushes one box by contact and pulls another by a weld.
inline constexpr char kHand[] = R"(
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

}  // namespace mjsense::worlds
