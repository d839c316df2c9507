# SPDX-License-Identifier: Apache-2.0
import ctypes
import gc
import threading

import gymnasium
import mujoco
import numpy as np
import pytest
from scenes import ARM, ball_scene, feet_cfg

import mjsense as mjs


@pytest.fixture
def sim():
    return mjs.Simulation(ball_scene(), num_worlds=4, decimation=5)


def test_live_views(sim):
    assert sim.qpos.shape == (4, 7) and sim.qpos.dtype == np.float64
    sim.qpos[:, 2] = [1, 2, 3, 4]
    sim.forward()
    assert sim.data.xpos[:, -1, 2].tolist() == [1, 2, 3, 4]
    before = sim.qpos
    sim.step()
    assert np.shares_memory(before, sim.qpos) and before[0, 2] < 1


def test_step_equals_mujoco(sim):
    model = sim.scene.model
    data = mujoco.MjData(model)
    sim.step(3)
    for _ in range(15):
        mujoco.mj_step(model, data)
    np.testing.assert_array_equal(sim.qpos[2], data.qpos)
    np.testing.assert_allclose(sim.time, 15 * 0.002)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_bits_do_not_depend_on_threads(threads):
    sim = mjs.Simulation(ball_scene(), num_worlds=7, threads=threads)
    sim.qvel[:] = np.random.default_rng(0).normal(size=sim.qvel.shape)
    sim.forward()
    sim.step(50)
    alone = mjs.Simulation(ball_scene(), num_worlds=7, threads=1)
    alone.qvel[:] = np.random.default_rng(0).normal(size=sim.qvel.shape)
    alone.forward()
    alone.step(50)
    assert sim.state.tobytes() == alone.state.tobytes()
    assert sim.scene["ball/acc"].data.tobytes() == alone.scene["ball/acc"].data.tobytes()


def test_zero_copy_and_freshness(sim):
    sensor = sim.scene["ball/acc"]
    first = sensor.data
    assert first.dtype == np.float32 and first.shape == (4, 3)
    np.testing.assert_allclose(first, 0, atol=1e-6)  # free fall
    sim.qpos[:, 2] = 0.0995
    sim.forward()
    assert np.shares_memory(sensor.data, first) and np.all(first[:, 2] > 1)


def test_dlpack(sim):
    array = sim.scene["ball/acc"].data
    other = np.from_dlpack(array)
    assert np.shares_memory(array, other)


def test_partial_reset(sim):
    sim.step(10)
    sim.reset([1, 3])
    assert sim.time.tolist() == [0.1, 0, 0.1, 0]
    assert sim.qpos[1, 2] == 1 and sim.qpos[0, 2] < 1
    sim.reset(np.array([True, False, False, False]))
    assert sim.time[0] == 0
    sim.reset([])
    assert sim.time[2] == 0.1
    sim.reset()
    assert not sim.time.any()


@pytest.mark.parametrize("none", [[], (), np.array([], dtype=int), np.zeros(4, dtype=bool)])
def test_an_empty_list_of_worlds_is_none(sim, none):
    sim.step(3)
    before = sim.state.copy()
    sim.reset(none)
    sim.reset_sensors(none)
    sim.set_state(none, qpos=np.zeros((0, 7)))
    sim.randomize("geom_rgba", np.zeros((0, *sim.model.geom_rgba.shape)), none)
    sim.forward(none)
    sim.invalidate(none)
    np.testing.assert_array_equal(sim.state, before)
    assert not any(sim.model.geom_rgba[-1] == 0) and (sim.time > 0).all()
    sim.reset(None)
    assert not sim.time.any()


def test_reset_to_keyframe():
    xml = ARM.replace("</actuator>", '</actuator><keyframe><key qpos=".5 -.5"/></keyframe>')
    scene = mjs.Scene(mjs.SceneCfg(entities={"arm": mjs.EntityCfg(model=xml)}))
    sim = mjs.Simulation(scene, num_worlds=2)
    sim.reset(key="init_state")
    np.testing.assert_allclose(sim.qpos, [[0.5, -0.5]] * 2)
    with pytest.raises(ValueError, match="no keyframe 'home'"):
        sim.reset(key="home")


def test_set_state(sim):
    sim.set_state(qpos=[0, 0, 5, 1, 0, 0, 0])
    assert sim.data.xpos[:, -1, 2].tolist() == [5] * 4
    sim.set_state([0, 2], qpos=[[0, 0, 6, 1, 0, 0, 0], [0, 0, 7, 1, 0, 0, 0]])
    assert sim.data.xpos[:, -1, 2].tolist() == [6, 5, 7, 5]
    with pytest.raises(ValueError, match="qpos: shape"):
        sim.set_state(qpos=[1, 2])
    with pytest.raises(KeyError, match="did you mean 'qpos'"):
        sim.set_state(qpo=[1])
    before = sim.data.qpos.copy()
    with pytest.raises(ValueError, match="qvel: shape"):  # and nothing is written
        sim.set_state(qpos=[0, 0, 9, 1, 0, 0, 0], qvel=[1])
    np.testing.assert_array_equal(sim.data.qpos, before)


def test_the_time_has_no_rounding_errors_of_mujocos_sum(sim):
    sim.step_raw(3000)
    assert sim.state[0, 0] != 3000 * sim.physics_dt
    assert sim.time.tolist() == [3000 * sim.physics_dt] * 4


def test_values_of_the_state_are_errors_that_name_the_component(sim):
    before = sim.state.copy()
    for value, text in [(np.zeros(3), r"shape \(3,\) does not broadcast to \(4, 7\)"), ("up", "numbers, not 'up'"), (None, "numbers, not None")]:
        for owner in (sim, sim.data):
            with pytest.raises(ValueError, match=f"qpos: .*{text}"):
                owner.qpos = value
    with pytest.raises(ValueError, match="qpos: values must be numbers, not None"):
        sim.set_state(qpos=None)
    with pytest.raises(ValueError, match="keyframe -2: the model has"):
        sim.reset(key=-2)
    np.testing.assert_array_equal(sim.state, before)


def test_randomize_errors_name_the_field(sim):
    for call, error, text in [
        (lambda: sim.randomize("bodymass", 1), AttributeError, "did you mean 'body_mass'"),
        (lambda: sim.randomize("body_mass", np.ones((4, 99))), ValueError, r"body_mass: shape \(4, 99\) does not broadcast to \(4, "),
        (lambda: sim.randomize("body_mass", "heavy"), ValueError, "body_mass: values must be numbers, not 'heavy'"),
        (lambda: sim.randomize("body_mass", -1), ValueError, r"body_mass: values must be at least 0; that of world 0, element \[0\] is -1"),
        (lambda: sim.randomize("geom_group", 1.5), ValueError, "geom_group: values must be integers, not 1.5"),
        (lambda: sim.randomize("geom_group", np.nan), ValueError, "geom_group: values must be integers, not nan"),
        (lambda: sim.randomize("body_mass", np.inf), ValueError, r"finite numbers; that of world 0, element \[0\] is inf"),
        (lambda: sim.randomize("body_pos", [[0, 0, 1], [0, np.nan, 1], [0, 0, 1]], [3]), ValueError, r"that of world 3, element \[1, 1\] is nan"),
        (lambda: sim.randomize("geom_matid", sim.model.nmat), ValueError, "geom_matid: ids from"),
        (lambda: sim.randomize("mesh_vert", 1), ValueError, "cannot have a value per world"),
    ]:
        with pytest.raises(error, match=text):
            call()


@pytest.mark.parametrize("simple", [True, False])
def test_values_that_mujoco_cannot_use_are_refused(simple):
    """MuJoCo's fast path for a body whose centre of mass is its origin ignores another centre of mass."""
    ball = f"""<body name="ball" pos="0 0 1" {"" if simple else 'simple="false"'}><freejoint/><geom size=".1"/></body>"""
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=f"<mujoco><worldbody>{ball}</worldbody></mujoco>")), 3)
    offsets = np.zeros((3, 2, 3))
    offsets[1, 1, 0] = 0.02
    if simple:
        with pytest.raises(ValueError, match=r"body_ipos: .* values of world 1: .*body 'ball' is compiled as simple .* use body/simple='false'"):
            sim.randomize("body_ipos", offsets)
        assert (sim.model_field("body_ipos") == 0).all()
        sim.randomize("body_mass", 2.0)  # works as before
    else:
        sim.randomize("body_ipos", offsets)
    sim.qvel[:, 5] = 5
    sim.step(100)
    assert sim.failures == []
    assert (np.abs(sim.qpos[:, :2]).max(1) > 1e-3).tolist() == [False, not simple, False]


def test_randomize(sim):
    sim.randomize("body_mass", [[0, 0, m] for m in (1, 2, 3, 4)] if sim.model.nbody == 3 else 1)
    sim.qpos[:, 2] = 0.0995
    sim.forward()
    assert sim.model_field("body_mass")[:, 2].tolist() == [1, 2, 3, 4]
    force = sim.data.qfrc_constraint[:, 2]
    assert np.all(np.diff(force) > 0)
    with pytest.raises(AttributeError, match="no array 'bodymass'"):
        sim.randomize("bodymass", 1)


def test_failed_world_is_reset_alone(sim):
    sim.step(2)
    sim.qvel[2, 0] = 1e20
    sim.step()
    assert [w for w, _ in sim.failures] == [2]
    assert sim.time.tolist() == [0.03, 0.03, 0, 0.03]


def test_bad_arguments(sim):
    for call, error in [
        (lambda: sim.step(0), ValueError),
        (lambda: sim.step("2"), TypeError),
        (lambda: sim.reset([4]), ValueError),
        (lambda: sim.reset([1, 1]), ValueError),
        (lambda: sim.reset([0.5]), TypeError),
        (lambda: sim.step_raw(-1), ValueError),
        (lambda: sim.set_state([-1], qpos=np.zeros(7)), ValueError),
        (lambda: sim.randomize("body_mass", 1, [5]), ValueError),
        (lambda: sim.refresh([17]), TypeError),
        (lambda: sim.data.xposs, AttributeError),
        (lambda: mjs.Simulation(sim.scene), RuntimeError),
        (lambda: mjs.Simulation(ball_scene(), num_worlds=0), ValueError),
        (lambda: mjs.Simulation(ball_scene(), num_worlds=2.5), TypeError),
        (lambda: mjs.Simulation(ball_scene(), decimation=0), ValueError),
        (lambda: mjs.Simulation(ball_scene(), threads=-2), ValueError),
        (lambda: mjs.Simulation("scene"), TypeError),
        (lambda: setattr(sim, "qpos", np.zeros((3, 3))), ValueError),
    ]:
        with pytest.raises(error):
            call()
    sim.step()
    assert np.all(sim.qpos[:, 2] > 0.9)  # nothing was written on the way


def test_use_after_close():
    sim = mjs.Simulation(ball_scene(), num_worlds=2)
    sensor, qpos = sim.scene["ball/acc"], sim.qpos
    acc = sensor.data
    sim.close()
    sim.close()
    for call in (sim.step, sim.forward, sim.reset, lambda: sim.qpos, lambda: sim.state, lambda: sensor.data, lambda: sim.data.xpos):
        with pytest.raises(RuntimeError, match="closed"):
            call()
    assert qpos[0, 2] == 1 and acc.shape == (2, 3)  # arrays outlive it


def test_arrays_keep_their_memory():
    def rows():
        sim = mjs.Simulation(ball_scene(), num_worlds=3)
        sim.qpos[:, 2] = 7
        return sim.qpos, sim.scene["ball/acc"].data

    qpos, acc = rows()
    gc.collect()
    other = [mjs.Simulation(ball_scene(), num_worlds=3) for _ in range(3)]  # would take the memory if it were free
    assert qpos[:, 2].tolist() == [7] * 3 and acc.shape == (3, 3) and len(other) == 3


READS = {
    "qpos": lambda sim, own: sim.qpos,
    "state": lambda sim, own: sim.state,
    "data.qvel": lambda sim, own: sim.data.qvel,
    "data.xpos": lambda sim, own: sim.data.xpos,
    "model_field": lambda sim, own: sim.model_field("geom_size"),
    "sensor": lambda sim, own: sim.scene["ball/acc"].data,
    "fields": lambda sim, own: sim.scene["ball/acc"].fields[""],
    "image": lambda sim, own: sim.scene["eye"].data.rgb,
    "own data": lambda sim, own: own.data["a"],
    "own rows": lambda sim, own: own.rows["a"],
}


class Own(mjs.Sensor):
    def __init__(self):
        super().__init__("own", gymnasium.spaces.Dict({"a": gymnasium.spaces.Box(-1, 1, (2, 3), np.float32)}))

    def compute(self, sim):
        return {"a": np.zeros((sim.num_worlds, 2, 3), np.float32)}


@pytest.mark.parametrize("name", READS)
def test_the_shape_of_an_array_is_its_readers_own(name):
    sim = mjs.Simulation(ball_scene(mjs.CameraSensorCfg(name="eye", width=16, height=8)), num_worlds=2)
    own = sim.add(Own())
    before = READS[name](sim, own)
    shape, dtype, strides = before.shape, before.dtype, before.strides
    before.shape = (1, *shape)
    READS[name](sim, own).dtype = np.uint8
    after = READS[name](sim, own)
    assert (after.shape, after.dtype, after.strides) == (shape, dtype, strides)
    assert np.shares_memory(before, after)
    assert after.flags.writeable == (name in ("qpos", "state", "data.qvel", "model_field"))


def test_calls_from_several_threads_are_serialised(sim):
    errors = []

    def work():
        try:
            for _ in range(50):
                sim.step()
                sim.scene["ball/acc"].data
        except Exception as error:  # pragma: no cover
            errors.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    np.testing.assert_allclose(sim.time, 4 * 50 * 0.01)


def test_data_before_simulation():
    with pytest.raises(RuntimeError, match="'ball/acc' has no data yet"):
        ball_scene()["ball/acc"].data


def test_raw_step_leaves_outdated_fields_until_forward():
    scene = ball_scene(mjs.BuiltinSensorCfg(name="pos", sensor_type="framepos", obj=mjs.ObjRef("site", "imu", "ball")))
    sim = mjs.Simulation(scene)
    sim.qvel[0, 2] = 5
    sim.step_raw()
    assert scene["ball/pos"].data[0, 2] == 1
    sim.forward()
    assert scene["ball/pos"].data[0, 2] > 1


def test_contact_data_and_air_time():
    scene = ball_scene(feet_cfg(fields=("found", "force", "normal", "tangent"), global_frame=True, track_air_time=True))
    sim = mjs.Simulation(scene, num_worlds=2, decimation=5)
    sim.qpos[0, 2], sim.qpos[1, 2] = 0.0995, 200
    sim.forward()
    sim.step(400)
    data = scene["touch"].data
    assert data.found[:, 0].tolist() == [1, 0]
    np.testing.assert_allclose(data.force[0, 0], [0, 0, -9.81], atol=0.05)
    assert data.dist is None and data.force_history is None
    assert data.current_air_time[1, 0] == pytest.approx(4, abs=0.01)
    assert scene["touch"].primary_names == ("ball",)
    assert scene["touch"].compute_first_contact(sim.step_dt).tolist() == [[False], [False]]
    assert "found=float32[2, 1]" in repr(data)


CROWD = (
    "<mujoco><size memory='12K'/><worldbody><geom type='plane' size='5 5 .1'/>"
    + "".join(f"<body pos='{0.05 * i} 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'/></body>" for i in range(6))
    + "</worldbody></mujoco>"
)


def test_warnings_are_counted_and_reported_once(capfd):
    """Six boxes in memory for few contacts: MuJoCo warns in every world after every reset."""
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=CROWD)), num_worlds=4)
    for _ in range(3):
        sim.step(3)
        sim.reset()
    assert set(sim.warning_counts) == {"mjWARN_CONTACTFULL"}
    assert sim.warning_counts["mjWARN_CONTACTFULL"].shape == (4,) and (sim.warning_counts["mjWARN_CONTACTFULL"] >= 9).all()
    err = capfd.readouterr().err
    assert err.count("WARNING") == err.count("Too many contacts") == 1 and "world 0" in err
    data = mujoco.MjData(sim.model)
    mujoco.mj_forward(sim.model, data)  # MuJoCo of one's own warns as ever
    assert capfd.readouterr().err.count("Too many contacts") == 1


@pytest.mark.parametrize("field", ["geom_quat", "body_quat", "site_quat"])
def test_a_quaternion_of_length_zero_is_refused(field):
    sim = mjs.Simulation(ball_scene(), num_worlds=3)
    values = np.array(sim.model_field(field))
    values[1, -1] = 0
    with pytest.raises(ValueError, match=rf"{field}: values must be quaternions; that of world 1, element \[\d\], has length 0"):
        sim.randomize(field, values)
    assert np.linalg.norm(sim.model_field(field), axis=-1).min() > 0.9
    sim.step()
    assert sim.failures == []


def test_a_quaternion_of_length_zero_written_directly_affects_its_world_alone():
    floor = "<geom type='plane' size='5 5 .1' euler='1 0 0' pos='0 0 .001'/>"
    ball = "<body pos='0 0 .09'><freejoint/><geom type='sphere' size='.1'/></body>"
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=f"<mujoco><worldbody>{floor}{ball}</worldbody></mujoco>")), num_worlds=3)
    field = sim.model_field("geom_quat")
    good = np.array(field)
    field[1, 0] = 0
    sim.step()  # it starts from the positions that were computed before the write
    for _ in range(2):
        sim.step()
        assert [world for world, _ in sim.failures] == [1]
        assert "fails even after a reset" in sim.failures[0][1]
        assert np.isfinite(sim.data.xpos[[0, 2]]).all()
    np.testing.assert_allclose(sim.time, [0.006, 0.002, 0.006])  # world 1: of its last good step
    field[:] = good
    sim.step()
    assert sim.failures == []
    np.testing.assert_allclose(sim.time, [0.008, 0.002, 0.008])


def test_python_callbacks_are_refused_by_name(sim):
    """MuJoCo's Python callbacks know objects of Python alone; function pointers work."""
    try:
        mujoco.set_mjcb_sensor(lambda model, data, stage: None)
        with pytest.raises(RuntimeError, match=r"mjcb_sensor is a Python function.*mujoco.set_mjcb_sensor\(None\)"):
            sim.step()
        with pytest.raises(RuntimeError, match="mjcb_sensor is a Python function"):
            ball_scene()
        with pytest.raises(RuntimeError, match="mjcb_sensor is a Python function"):
            mjs.make_vec("pick", num_envs=1, cameras=[])
        mujoco.set_mjcb_sensor(None)
        calls = []
        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
        pointer = kind(lambda model, data, stage: calls.append(stage))
        mujoco.set_mjcb_control(ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(lambda model, data: calls.append(-1)))
        mujoco.set_mjcb_passive(None)
        sim.step()
        assert sim.failures == [] and -1 in calls
        assert pointer
    finally:
        for name in ("sensor", "control"):
            getattr(mujoco, f"set_mjcb_{name}")(None)
    sim.step()


def test_names_do_not_control_the_terminal():
    """A name with ESC in it, as errors, warnings and a sensor's text show it."""
    model = "<mujoco><worldbody><body name='a&#27;[31m'><geom size='.1'/><site name='s'/></body></worldbody><sensor>{}</sensor></mujoco>"
    scene = mjs.Scene(mjs.SceneCfg(base=model.format("<gyro name='g&#27;[2J' site='s'/>")))
    sim = mjs.Simulation(scene, num_worlds=1)
    texts = [repr(scene["g\x1b[2J"]), repr(scene)]
    with pytest.raises(KeyError) as error:
        scene["nothing"]
    texts.append(str(error.value))
    match = mjs.ContactMatch(mode="body", pattern="a..31", entity="e")
    with pytest.raises(ValueError) as error:
        mjs.Scene(
            mjs.SceneCfg(
                entities={"e": mjs.EntityCfg(model=model.format(""))}, sensors=[mjs.ContactSensorCfg(name="c", primary=match)]
            )
        )
    texts.append(str(error.value))
    assert any("?[31m" in text for text in texts) and any("?[2J" in text for text in texts)
    assert not any("\x1b" in text for text in texts), texts
    sim.close()


def test_a_mask_selects_worlds_everywhere(sim, tmp_path):
    """Booleans are not the ids 0 and 1, and a mask has one entry for each world."""
    mask = [False, False, True, False]
    sim.step()
    sim.reset(mask)
    assert (sim.time == 0).tolist() == mask
    pipeline = mjs.sensors.ObservationPipeline(4, history_length=2)
    for value in (1.0, 2.0):
        pipeline(np.full((4, 1), value))
    pipeline.reset(mask)
    assert (pipeline(np.full((4, 1), 3.0))[:, 0] == 3).tolist() == mask
    with mjs.Recorder(sim, tmp_path) as recorder:
        for world in range(4):
            recorder.begin_episode(world, world)
            recorder.append(np.arange(4) == world)
        recorder.finish_episode(2)
        for world in (0, 1, 3):
            recorder.abandon_episode(world)
    for call in (sim.reset, sim.forward, pipeline.reset, mjs.Recorder(sim, tmp_path / "more").append):
        with pytest.raises(ValueError, match=r"world_ids: a mask of shape \(2,\) for 4 worlds"):
            call([True, False])
