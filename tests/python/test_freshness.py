# SPDX-License-Identifier: Apache-2.0
"""Reads and writes between steps do not change the states: they equal those of plain mj_step bit for bit."""

import mujoco
import numpy as np
import pytest

import mjsense as mjs

XML = """
<mujoco>
  <option timestep="0.004" integrator="{integrator}"/>
  <size nuserdata="2"/>
  <worldbody>
    <geom type="plane" size="0 0 .1"/>
    <body name="post" mocap="true" pos="0.2 0 .05"><geom type="box" size=".02 .1 .05"/></body>
    <body name="cart" pos="0 0 .3"><joint name="hinge" axis="0 1 0"/>
      <geom name="rod" type="capsule" fromto="0 0 0 .3 0 0" size=".03"/><site name="tip" pos=".3 0 0"/></body>
    <body name="ball" pos=".1 .3 .06"><freejoint/><geom name="ball" type="sphere" size=".06"/></body>
  </worldbody>
  <actuator><motor joint="hinge"/></actuator>
  <equality><joint joint1="hinge" active="false"/></equality>
  <sensor>
    <framepos name="place" objtype="site" objname="tip"/>
    <velocimeter name="velocity" site="tip"/>
    <accelerometer name="acceleration" site="tip"/>
  </sensor>
</mujoco>"""
WORLDS = 3


def simulation(integrator, threads, decimation):
    scene = mjs.Scene(mjs.SceneCfg(base=XML.format(integrator=integrator)))
    sim = mjs.Simulation(scene, WORLDS, decimation=decimation, threads=threads)
    return sim, [scene[name] for name in ("place", "velocity", "acceleration")]


def write(sim, plain, models, k, rng):
    """One kind of write a step, to the simulation and to plain mjData alike."""
    kind = k % 12
    world = int(rng.integers(WORLDS))
    if kind == 0:
        sim.qpos[world, 0] = plain[world].qpos[0] = rng.uniform(-1, 1)
    elif kind == 1:
        qvel = rng.uniform(-1, 1, (WORLDS, sim.model.nv))
        sim.set_state(qvel=qvel)
        for d, row in zip(plain, qvel):
            d.qvel[:] = row
    elif kind == 2:
        sim.reset([world])
        mujoco.mj_resetData(models[world], plain[world])
    elif kind == 3:
        sim.mocap_pos[world, 0, 0] = plain[world].mocap_pos[0, 0] = rng.uniform(0, 0.3)
    elif kind == 4:
        sim.userdata[world, 1] = plain[world].userdata[1] = k
    elif kind == 5:
        force = rng.uniform(-1, 1)
        sim.qfrc_applied[world, 0] = plain[world].qfrc_applied[0] = force
    elif kind == 6:
        sim.xfrc_applied[world, 3, 2] = plain[world].xfrc_applied[3, 2] = 4.0
    elif kind == 7:
        sim.eq_active[world] = plain[world].eq_active[:] = k // 12 % 2
    elif kind == 8:
        sim.randomize("geom_friction", 0.5 + 0.1 * world, [world])
        models[world].geom_friction[:] = 0.5 + 0.1 * world
    elif kind == 9:
        sim.set_state([world], forward=False, qpos=plain[world].qpos + 0.01)
        plain[world].qpos[:] += 0.01
    elif kind == 10:
        sim.mocap_quat[world, 0] = plain[world].mocap_quat[0] = (0.8, 0, 0, 0.6)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("decimation", [1, 4])
@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_writes_and_reads_between_steps(integrator, decimation, threads):
    sim, read = simulation(integrator, threads, decimation)
    models = [sim.model.__copy__() for _ in range(WORLDS)]
    plain = [mujoco.MjData(m) for m in models]
    fresh = mujoco.MjData(sim.model)
    rng = np.random.default_rng(1)
    for k in range(60):
        write(sim, plain, models, k, rng)
        if k % 5 == 3:  # a read between the write and the step
            sim.refresh(read[: 1 + k % 3])
        sim.ctrl[:, 0] = np.sin(0.1 * (k // 3) + np.arange(WORLDS))
        sim.step()
        assert sim.failures == []
        values = [sensor.data.copy() for sensor in read[k % 3 : k % 4]]  # none, one, two or all
        for w, (m, d) in enumerate(zip(models, plain)):
            d.ctrl[0] = np.sin(0.1 * (k // 3) + w)
            for _ in range(decimation):
                mujoco.mj_step(m, d)
            row = np.empty(mujoco.mj_stateSize(m, mujoco.mjtState.mjSTATE_INTEGRATION))
            mujoco.mj_getState(m, d, row, mujoco.mjtState.mjSTATE_INTEGRATION)
            time = sim.state[w, 0]
            np.testing.assert_array_equal(sim.state[w], row, err_msg=f"step {k}, world {w}, time {time}")
            mujoco.mj_copyData(fresh, m, d)
            mujoco.mj_forward(m, fresh)
            for sensor, value in zip(range(k % 3, k % 4), values):
                np.testing.assert_array_equal(value[w], fresh.sensordata[3 * sensor : 3 * sensor + 3].astype(np.float32))


def test_fields_of_mjdata_are_fresh_whatever_was_read_before():
    sim, _read = simulation("implicitfast", 1, 2)
    fresh = mujoco.MjData(sim.model)
    sim.qpos[:, 0] = 0.6
    sim.forward()
    for names in (["xpos"], ["cvel", "qacc"], ["qfrc_constraint"], [], ["qfrc_bias", "xpos", "actuator_force"]):
        for k in range(4):
            sim.ctrl[:] = 0.1 * k
            sim.step()
            mujoco.mj_setState(sim.model, fresh, sim.state[1], mujoco.mjtState.mjSTATE_INTEGRATION)
            mujoco.mj_forward(sim.model, fresh)
            sim.ctrl[:] = -1.0  # of the next step: what was measured is not touched
            for name in names:
                np.testing.assert_array_equal(getattr(sim.data, name)[1].ravel(), np.ravel(getattr(fresh, name)), err_msg=name)
