# SPDX-License-Identifier: Apache-2.0
"""mjsense.attach: sensors over data that the test steps itself."""

import copy
import dataclasses
import gc
import resource
import threading
import time

import gymnasium
import mujoco
import numpy as np
import pytest
from test_renderer_threads import run_all

import mjsense as mjs

MODEL = """
<mujoco>
  <option timestep="0.005"/>
  <asset>
    <texture name="checker" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="16" height="16"/>
    <material name="checker" texture="checker"/>
  </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="5 5 .1" material="checker"/>
    <camera name="front" pos="0 -2 1" xyaxes="1 0 0 0 .5 1"/>
    <body name="box" pos="0 0 .3">
      <freejoint/>
      <geom type="box" size=".1 .1 .1" rgba="1 0 0 1"/>
      <site name="imu"/>
      <camera pos="0 0 .2"/>
    </body>
    <body name="arm" pos=".5 0 .5">
      <joint name="shoulder" axis="0 1 0"/>
      <geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
      <body pos=".3 0 0">
        <joint axis="0 1 0" limited="true" range="-1 1"/>
        <geom type="capsule" fromto="0 0 0 .2 0 0" size=".03"/>
        <site name="tip" pos=".2 0 0"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="fixed"><joint joint="shoulder" coef="1"/></fixed>
    <spatial name="spatial" limited="true" range="0 3"><site site="imu"/><site site="tip"/></spatial>
  </tendon>
  <actuator><motor joint="shoulder" gear="1"/><position tendon="fixed" kp="1"/></actuator>
  <sensor><gyro name="gyro" site="imu"/><jointpos joint="shoulder"/></sensor>
  <keyframe><key name="high" qpos="0 0 1 1 0 0 0 0 0"/></keyframe>
</mujoco>"""
STEPS = 200


class Speed(mjs.Sensor):
    """Mean speed since the reset, by world."""

    def __init__(self):
        super().__init__("speed", gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float64))
        self.distance = 0.0

    def initialize(self, sim):
        self.worlds = sim.num_worlds
        self.seconds = np.zeros(sim.num_worlds)

    def update(self, dt):
        self.seconds += dt

    def reset(self, world_ids=None):
        self.seconds[slice(None) if world_ids is None else world_ids] = 0

    def compute(self, sim):
        return np.stack([np.linalg.norm(sim.data.qvel, axis=1), self.seconds], axis=1)


def sensors():
    ref = mjs.ObjRef
    return (
        mjs.CameraSensorCfg(name="front", camera_name="front", width=32, height=24, data_types=("rgb", "depth", "segmentation")),
        mjs.CameraSensorCfg(name="mounted", parent_body="box", pos=(0, 0, 0.3), quat=(0.7, 0.7, 0, 0), width=16, height=12, data_types=("rgb",)),
        mjs.BuiltinSensorCfg(name="acc", sensor_type="accelerometer", obj=ref("site", "imu")),
        mjs.BuiltinSensorCfg(name="limit", sensor_type="jointlimitpos", obj=ref("joint", "joint_2")),
        mjs.BuiltinSensorCfg(name="length", sensor_type="tendonpos", obj=ref("tendon", "spatial")),
        mjs.BuiltinSensorCfg(name="force", sensor_type="actuatorfrc", obj=ref("actuator", "actuator_1")),
        mjs.BuiltinSensorCfg(name="seen", sensor_type="framepos", obj=ref("site", "tip"), ref=ref("camera", "mounted")),
        mjs.ImuSensorCfg(name="imu", site=ref("site", "imu"), orientation=True, preset="mpu6050"),
        mjs.ContactSensorCfg(
            name="touch", primary=mjs.ContactMatch(mode="geom", pattern=("geom_1", "upper", "geom_3")), fields=("found", "force", "pos"),
            track_air_time=True, history_length=3,
        ),
        mjs.RayCastSensorCfg(name="rays", frame=(ref("site", "tip"),), pattern=mjs.GridPatternCfg(size=(0.2, 0.2), resolution=0.1)),
        mjs.TerrainHeightSensorCfg(name="height", frame=(ref("site", "tip"),)),
        mjs.LidarSensorCfg(name="lidar", frame=(ref("site", "imu"),), scan=mjs.SpinningScanCfg(channels=4, samples=8), range_noise_std=0.01),
        mjs.EffectSensorCfg(name="late", sensor="acc", effects=(mjs.effects.Noise(mjs.effects.Gaussian(0.1)), mjs.effects.Delay(delay_s=0.02))),
        Speed(),
    )  # fmt: skip


def started(worlds, xml=MODEL):
    """A model and data that differ, with controls."""
    model = mujoco.MjModel.from_xml_string(xml)
    datas = [mujoco.MjData(model) for _ in range(worlds)]
    for world, data in enumerate(datas):
        data.qvel[:] = 0.3 * world
        data.ctrl[:] = 0.2 * world
    return model, datas


def simulated(datas, decimation=1):
    """A Simulation of the same scene, in the states of these data."""
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=MODEL, sensors=sensors())), len(datas), decimation)
    for world, data in enumerate(datas):
        sim.qvel[world], sim.ctrl[world] = data.qvel, data.ctrl
    sim._core.reset(None, -2, None)
    return sim


def fields_of(sensor):
    data = sensor.data
    if isinstance(data, np.ndarray):
        return {"": data}
    return {f.name: getattr(data, f.name) for f in dataclasses.fields(data) if isinstance(getattr(data, f.name), np.ndarray)}


def assert_equal(attached, scene, step=0):
    for name in attached:
        found, expected = fields_of(attached[name]), fields_of(scene[name])
        assert found.keys() == expected.keys()
        for field, values in found.items():
            assert np.array_equal(values, expected[field], equal_nan=values.dtype.kind == "f"), (step, name, field, values, expected[field])


def test_every_sensor_equals_that_of_a_simulation_bit_for_bit():
    model, datas = started(3)
    sim = simulated(datas)
    with mjs.attach(model, datas, sensors()) as attached:
        assert attached.num_worlds == 3 and {"front", "late", "gyro", "sensor_1", "imu_acc"} <= {*attached.sensors}
        for step in range(STEPS):
            assert_equal(attached, sim.scene, step)
            for data in datas:
                mujoco.mj_step(model, data)
            attached.update()
            sim.step()
        assert attached["touch"].data.found.any() and attached["touch"].data.current_air_time.any()


def test_one_update_for_several_steps_advances_memory_by_the_time_of_the_data():
    model, (data,) = started(1)
    sim = simulated([data], decimation=4)
    attached = mjs.attach(model, data, sensors(), decimation=4)
    for _ in range(25):
        assert_equal({n: attached[n] for n in ("front", "acc", "imu", "late", "speed", "lidar")}, sim.scene)
        for _ in range(4):
            mujoco.mj_step(model, data)
        attached.update()
        sim.step()
    assert attached["speed"].data[0, 1] == pytest.approx(100 * 0.005)
    assert attached.time == pytest.approx(data.time)


def test_worlds_may_be_at_different_times_and_are_reset_one_by_one():
    model, datas = started(2)
    attached = mjs.attach(model, datas, (Speed(),))
    for _ in range(10):
        mujoco.mj_step(model, datas[1])
    attached.update()
    attached.update()  # nothing has changed
    assert attached["speed"].data[:, 1].max() == pytest.approx(0.05)
    mujoco.mj_resetData(model, datas[1])
    with pytest.raises(ValueError, match=r"time of data\[1\] went back from 0.05 s to 0 s: call reset\(\[1\]\)"):
        attached.update()
    attached.reset([1])
    assert attached["speed"].data[1].tolist() == [0, 0]
    attached.update()


def test_a_state_that_was_edited_shows_without_a_step():
    model, (data,) = started(1)
    attached = mjs.attach(model, data, sensors())
    before = attached["front"].data.rgb.copy()
    mujoco.mj_resetDataKeyframe(model, data, 0)
    attached.update()
    assert not np.array_equal(before, attached["front"].data.rgb)
    data.qpos[2] = np.nan
    with pytest.raises(ValueError, match=r"state of data\[0\] is not finite: qpos, number 2, is nan"):
        attached.update()


def test_the_model_and_data_of_the_program_are_not_changed():
    model, datas = started(2)
    mujoco.mj_step(model, datas[0])
    size, buffer = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION), np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    state = np.empty(size)
    mujoco.mj_getState(model, datas[0], state, mujoco.mjtState.mjSTATE_INTEGRATION)
    derived = datas[0].xpos.copy(), datas[0].sensordata.copy()
    attached = mjs.attach(model, datas, sensors())
    attached.update()
    fields_of(attached["front"])
    after, again = np.empty(size), np.empty_like(buffer)
    mujoco.mj_getState(model, datas[0], after, mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_saveModel(model, None, again)
    assert np.array_equal(state, after) and np.array_equal(buffer, again)
    assert np.array_equal(derived[0], datas[0].xpos) and np.array_equal(derived[1], datas[0].sensordata)


def test_reload_follows_edits_of_the_model():
    model, (data,) = started(1)
    attached = mjs.attach(model, data, sensors())
    red = attached["front"].data.rgb.copy()
    model.geom("upper").rgba[:] = [0, 1, 0, 1]
    model.geom_rgba[1] = [0, 0, 1, 1]
    model.body_mass[1] *= 3
    model.geom_size[1] *= 2
    attached.reload()
    fresh = mjs.attach(model, data, sensors())
    assert not np.array_equal(red, attached["front"].data.rgb)
    assert_equal(attached, {name: fresh[name] for name in fresh})
    for _ in range(20):
        mujoco.mj_step(model, data)
        attached.update()
        fresh.update()
    assert_equal(attached, {name: fresh[name] for name in fresh})
    mujoco.mj_resetDataKeyframe(model, data, 0)
    model.opt.gravity[2] = -1
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    attached.reset()
    attached.reload()
    mujoco.mj_forward(model, data)
    assert data.ncon == 0 and np.array_equal(attached.simulation.data.qacc[0], data.qacc)
    model.opt.timestep = 0.001
    with pytest.raises(ValueError, match=r"time step was 0.005 s and is now 0.001 s: attach again"):
        attached.update()
    model.opt.timestep = 0.005
    model.tex_data[:] = 0
    with pytest.raises(ValueError, match=r"tex_data of the model of data\[0\] is different, which only a new attach\(\) follows"):
        attached.reload()


class Marker(mjs.Sensor):
    """Adds an element that no MjData has."""

    def __init__(self, **element):
        super().__init__("marker", gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64))
        self.element = element

    def edit_spec(self, spec):
        if "interval" in self.element:
            spec.add_sensor(name="slow", type=mujoco.mjtSensor.mjSENS_CLOCK, nsample=4, **self.element)
        else:
            spec.body("box").add_site(name="mark", **self.element)

    def compute(self, sim):
        return np.zeros((sim.num_worlds, 1))


def test_errors():
    model, (data,) = started(1)
    with pytest.raises(TypeError, match=r"model must be a mujoco.MjModel, not 3"):
        mjs.attach(3, data)
    with pytest.raises(TypeError, match=r"data\[1\] must be a mujoco.MjData, not None"):
        mjs.attach(model, [data, None])
    with pytest.raises(ValueError, match=r"data\[0\] is given twice"):
        mjs.attach(model, [data, data])
    with pytest.raises(ValueError, match="got 2 models for 1 data"):
        mjs.attach([model, model], data)
    with pytest.raises(ValueError, match="data is empty"):
        mjs.attach(model, [])
    other = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(ValueError, match=r"data\[0\] belongs to another model: its qpos has 0 numbers, and this model's has 9"):
        mjs.attach(model, mujoco.MjData(other))
    spec = mujoco.MjSpec.from_string(MODEL)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    with pytest.raises(ValueError, match=r"data\[0\] belongs to another model: it has 5 geoms, and this model has 4"):
        mjs.attach(model, mujoco.MjData(spec.compile()))
    with pytest.raises(KeyError, match="camera 'a': no camera named 'fornt'; did you mean 'front'"):
        mjs.attach(model, data, (mjs.CameraSensorCfg(name="a", camera_name="fornt"),))
    with pytest.raises(ValueError, match="sensor 'gyro': already exists"):
        mjs.attach(model, data, (mjs.BuiltinSensorCfg(name="gyro", sensor_type="gyro", obj=mjs.ObjRef("site", "imu")),))
    with pytest.raises(ValueError, match=r"the model has no site 'mark', which a sensor needs: add <site name=.mark..*/> to the model's XML"):
        mjs.attach(model, data, (Marker(pos=[0, 0, 1]),))
    with pytest.raises(ValueError, match=r'the model has no sensor \'slow\', which a sensor needs: add <clock name="slow".*/> to the model\'s XML, in <sensor>'):
        mjs.attach(model, data, (Marker(interval=[0.1, 0]),))
    attached = mjs.attach(model, data, (Speed(),))
    with pytest.raises(mjs.UnknownNameError, match="no sensor named 'sped' is attached; did you mean 'speed'"):
        attached["sped"]
    with pytest.raises(ValueError, match="world"):
        attached.reset([1])
    with pytest.raises(TypeError, match="cannot be copied or pickled: attach to the copy of the model and data"):
        copy.deepcopy(attached)
    attached.close()
    with pytest.raises(RuntimeError, match="closed"):
        attached.update()


def test_measurements_are_what_mujoco_computes_for_the_state():
    model, (data,) = started(1)
    net = mjs.ContactSensorCfg(name="net", primary=mjs.ContactMatch(mode="body", pattern=("box",)), fields=("force",), reduce="netforce")
    attached = mjs.attach(model, data, (net,))
    for _ in range(100):
        mujoco.mj_step(model, data)
    attached.update()
    mujoco.mj_forward(model, data)
    assert attached["gyro"].data[0] == pytest.approx(data.sensor("gyro").data, abs=1e-7)
    total, wrench = np.zeros(3), np.zeros(6)
    for i, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, i, wrench)
        if 1 in contact.geom:
            total += contact.frame.reshape(3, 3).T @ wrench[:3]
    assert total[2] > 1 and np.abs(attached["net"].data.force[0, 0, 2]) == pytest.approx(abs(total[2]), rel=1e-6)


def test_a_world_may_get_new_data_and_a_new_model():
    model, datas = started(2)
    attached = mjs.attach(model, datas, sensors())
    for _ in range(5):
        mujoco.mj_step(model, datas[1])
    attached.update()
    heavy = mujoco.MjModel.from_xml_string(MODEL.replace('size=".1 .1 .1"', 'size=".1 .1 .2"'))
    new = mujoco.MjData(heavy)
    attached.replace(1, new, heavy)
    assert attached.datas == (datas[0], new)
    fresh = mjs.attach([model, heavy], [datas[0], new], sensors())
    names = ("front", "touch", "height", "acc")
    assert_equal({n: attached[n] for n in names}, fresh)
    alone, own = mujoco.MjData(heavy), mujoco.MjModel.from_xml_string(MODEL)
    light = mjs.attach([own, heavy], [mujoco.MjData(own), alone], sensors())
    for _ in range(100):
        for data, made in ((datas[0], model), (new, heavy), (light.datas[0], own), (alone, heavy)):
            mujoco.mj_step(made, data)
        attached.update()
        light.update()
    only = mjs.attach(heavy, alone, sensors())
    for name in names[:1] + names[2:]:
        for field, values in fields_of(only[name]).items():
            assert np.array_equal(values[0], fields_of(attached[name])[field][1]) and np.array_equal(values[0], fields_of(light[name])[field][1])
    assert not np.array_equal(attached["front"].data.rgb[0], attached["front"].data.rgb[1])
    with pytest.raises(ValueError, match=r"replace\(\): data\[1\] belongs to another model: its qpos has 0 numbers, and this model's has 9"):
        attached.replace(1, mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>")))
    with pytest.raises(ValueError, match=r"replace\(\): data\[1\] is given twice"):
        attached.replace(1, datas[0])
    with pytest.raises(ValueError, match="world"):
        attached.replace(2, new)


def test_suites_and_recorders_take_attached_sensors(tmp_path):
    model, datas = started(2)
    with mjs.attach(model, datas, sensors()) as attached:
        suite = mjs.SensorSuite([attached["touch"], attached["acc"], attached.add(mjs.sensors.PoseSensor("pose", body="box"))])
        with mjs.Recorder(attached.simulation, tmp_path, suite, episodes=2) as recorder:
            for world in range(2):
                recorder.begin_episode(world, world)
            for _ in range(5):
                for data in datas:
                    mujoco.mj_step(model, data)
                attached.update()
                recorder.append()
            for world in range(2):
                recorder.finish_episode(world)
    assert mjs.Dataset(tmp_path).episodes[1]["obs/extra/acc"].shape == (5, 3)


def test_attaching_a_thousand_times_leaks_nothing():
    model, datas = started(2)

    def attach():
        with mjs.attach(model, datas, sensors()[1:9], threads=1) as attached:
            attached.update()

    def resident():
        with open("/proc/self/statm") as f:
            return int(f.read().split()[1]) * resource.getpagesize()

    for _ in range(50):
        attach()
    gc.collect()
    before = resident()
    for _ in range(1000):
        attach()
    gc.collect()
    assert resident() - before < 20e6


BUSY = "attached sensors: another thread is updating them; update them in one thread"


@pytest.mark.parametrize("call", ["update", "reset", "reload", "replace"])
def test_one_thread_at_a_time(call):
    model, datas = started(2)
    with mjs.attach(model, datas, sensors()[1:9], threads=1) as attached:
        work = getattr(attached, call) if call != "replace" else lambda: attached.replace(1, datas[1])
        with attached._guard:
            assert run_all(work) == {BUSY}
            work()  # of the same thread


def test_threads_update_read_and_close():
    model, datas = started(2)
    attached = mjs.attach(model, datas, sensors()[1:9], threads=2)
    updated = threading.Event()

    def update():
        for _ in range(30):
            for data in datas:
                mujoco.mj_step(model, data)
            attached.update()
        updated.set()

    found = [attached[name] for name in attached]  # looking a sensor up would warn that the data are ahead of it

    def read():
        while not updated.is_set():
            for sensor in found:
                sensor.data

    assert run_all(update, read, read) == set()

    def until_closed(work):
        while True:
            work()

    def close():
        time.sleep(0.2)
        attached.close()

    messages = run_all(lambda: until_closed(attached.update), lambda: until_closed(attached.reset), close)
    assert messages and all(message == BUSY or "closed" in message for message in messages)
