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


@pytest.mark.parametrize("steps", [0, 3])
def test_static_and_sleeping_bodies_follow_the_model(steps):
    xml = """<mujoco><option><flag sleep="enable"/></option><worldbody>
      <geom type="plane" size="3 3 .1"/><site/><camera/>
      <body pos="1 0 1"><geom size=".1"/><site/></body>
      <body pos="0 0 .1" sleep="init"><freejoint/><geom size=".1"/><site/><camera/></body></worldbody></mujoco>"""
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=xml)), 2)
    if steps:
        sim.step(steps)
    poses = {"body_pos": ("xpos", [1]), "geom_pos": ("geom_xpos", [1, 2]), "site_pos": ("site_xpos", [0, 1, 2]), "cam_pos": ("cam_xpos", [0, 1])}
    for field, (pose, moved) in poses.items():
        before = getattr(sim.data, pose).copy()
        change = np.zeros_like(getattr(sim.model, field))
        change[moved, 2] = 0.5
        sim.randomize(field, getattr(sim.model, field) + change, [1])
        np.testing.assert_array_equal(getattr(sim.data, pose)[0], before[0], err_msg=field)
        np.testing.assert_allclose((getattr(sim.data, pose) - before)[1, moved, 2], 0.5, err_msg=field)


def test_a_history_of_the_energy_does_not_depend_on_reads():
    xml = """<mujoco><option timestep="0.01"><flag energy="enable"/></option>
      <worldbody><body><joint axis="0 1 0" pos="0 0 .5"/><geom size=".1"/></body></worldbody>
      <sensor><e_kinetic name="now"/><e_kinetic name="energy" nsample="3"/></sensor>
      <keyframe><key qvel="2"/></keyframe></mujoco>"""
    read, unread = (mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=xml))) for _ in range(2))
    energies = []
    for sim in (read, unread):
        sim.reset(key=0)
    for _ in range(6):
        energies.insert(0, read.scene["now"].data.item())
        read.step()
        unread.step()
        np.testing.assert_array_equal(read.state, unread.state)
    np.testing.assert_array_equal(unread.scene["energy"].fields["history"][0, :, 0], energies[:3])


def sensors_with_memory():
    site, ball = mjs.ObjRef("site", "tip"), mjs.ContactMatch(mode="geom", pattern=("ball", "rod"))
    effects, clean = mjs.effects, {"sensor": "position"}
    return (
        mjs.LidarSensorCfg(
            name="sweep", frame=(site,), scan=mjs.SpinningScanCfg(channels=2, samples=9, rate_hz=20), motion_distortion=True, range_noise_std=0.01
        ),
        mjs.LidarSensorCfg(name="table", frame=(site,), scan=mjs.TableScanCfg(angles=[[0.1 * i, -0.3] for i in range(12)], rays_per_scan=4)),
        mjs.ContactSensorCfg(name="touch", primary=ball, track_air_time=True, track_events=True, latch=True, history_length=3),
        mjs.CameraSensorCfg(name="eye", parent_body="cart", width=8, height=6, data_types=("rgb", "depth"), update_period=0.02),
        mjs.ImuSensorCfg(name="imu", site=site, preset="mpu6050", orientation=True),
        mjs.BuiltinSensorCfg(name="position", sensor_type="framepos", obj=site),
        mjs.EffectSensorCfg(name="zero", effects=(effects.Dropout(0.5, mode="zero"),), **clean),
        mjs.EffectSensorCfg(name="nan", effects=(effects.Noise(0.1), effects.Dropout(0.5, mode="nan")), history_length=2, **clean),
        mjs.EffectSensorCfg(name="held", effects=(effects.Delay(0.01, jitter_s=0.005), effects.Dropout(0.5)), **clean),
        mjs.EffectSensorCfg(name="slow", sensor="eye", effects=(effects.Rate(30, random_phase=True), effects.StepDelay(0, 3))),
        mjs.EffectSensorCfg(name="lossy", sensor="touch", effects=(effects.Dropout(0.5, mode="zero"),)),
    )  # fmt: skip


def write_anything(sim, world, kind, rng):
    if kind == 0:
        sim.set_state([world], qpos=sim.qpos[world] + rng.uniform(-0.05, 0.05))
    elif kind == 1:
        sim.reset([world])
    elif kind == 2:
        sim.reset([w for w in range(WORLDS) if w != world])
    elif kind == 3:
        sim.qvel[world, 0] = np.nan  # the world is reset in the next step
    elif kind == 4:
        sim.randomize("geom_pos", sim.model.geom_pos + rng.uniform(0, 0.02), [world])
    elif kind == 5:
        sim.mocap_pos[world, 0] += 0.02
        sim.forward([world])
    elif kind == 6:
        sim.reset(seed=int(rng.integers(9)))


@pytest.mark.parametrize("decimation", [1, 3])
def test_values_depend_neither_on_earlier_reads_nor_on_worlds_and_threads(decimation):
    cfg = mjs.SceneCfg(base=XML.format(integrator="implicitfast"), sensors=sensors_with_memory())
    read_always = mjs.Simulation(mjs.Scene(cfg), WORLDS, decimation, threads=1, seed=3)
    read_sometimes = mjs.Simulation(mjs.Scene(cfg), WORLDS + 2, decimation, threads=3, seed=3)
    rng = np.random.default_rng(0)
    names = list(read_always.scene.sensors)
    for k in range(80):
        kind, world, seed = int(rng.integers(10)), int(rng.integers(WORLDS)), int(rng.integers(1000))
        control_steps = int(rng.integers(1, 3))
        for sim in (read_always, read_sometimes):
            write_anything(sim, world, kind, np.random.default_rng(seed))
            sim.ctrl[:] = np.sin(0.1 * k)
            sim.step(control_steps)
        np.testing.assert_array_equal(read_always.state, read_sometimes.state[:WORLDS])
        expected = {name: fields_of(read_always.scene[name]) for name in names}
        for name in rng.permutation(names)[: rng.integers(4)]:
            for field, values in fields_of(read_sometimes.scene[name]).items():
                message = f"step {k} after write {kind} to world {world}: {name}.{field}"
                np.testing.assert_array_equal(values[:WORLDS], expected[name][field], err_msg=message)


def fields_of(sensor):
    data = sensor.data
    if isinstance(data, np.ndarray):
        return {"": data.copy()}
    names = [name for name in dir(data) if not name.startswith("_")]
    return {name: value.copy() for name in names if isinstance(value := getattr(data, name), np.ndarray)}
