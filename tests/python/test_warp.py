# SPDX-License-Identifier: Apache-2.0
"""Simulation(backend="warp") on Warp's CPU device. tools/gpu_check.py compares more scenes, worlds and steps, on any device."""

import importlib.util
import inspect
import re
import subprocess
import sys
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import mjsense as mjs

INSTALLED = importlib.util.find_spec("mujoco_warp") is not None
needs_warp = pytest.mark.skipif(not INSTALLED, reason='needs mujoco_warp 4.0: pip install "mjsense[warp]"')
sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

XML = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1"/>
    <body name="ball" pos="0 0 .3"><freejoint/><geom name="ball" size=".1" mass="1"/><site name="middle"/></body>
    <body name="box" pos="1 0 .099"><freejoint/><geom name="box" type="box" size=".1 .1 .1" mass="1"/></body>
    <body name="arm" pos="3 0 1"><joint name="hinge" axis="0 1 0"/><geom name="arm" type="capsule" fromto="0 0 0 .3 0 0" size=".03"/></body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
  <sensor>
    <accelerometer name="acc" site="middle"/><gyro name="gyro" site="middle"/><jointpos name="angle" joint="hinge"/>
    <actuatorfrc name="force" actuator="motor"/>
  </sensor>
  <keyframe><key name="low" qpos="0 0 .1 1 0 0 0  1 0 .099 1 0 0 0  .5"/></keyframe>
</mujoco>"""


def touch(**options):
    return mjs.ContactSensorCfg("touch", mjs.ContactMatch("geom", ("ball", "box")), **options)


def simulation(*sensors, worlds=3, xml=XML, backend="warp", **options):
    scene = mjs.Scene(mjs.SceneCfg(base=xml, sensors=sensors))
    if backend == "warp":
        options = {"device": "cpu", **options}
    return mjs.Simulation(scene, worlds, backend=backend, **options)


def host(values):
    return np.array(values.cpu() if hasattr(values, "cpu") else values.numpy() if hasattr(values, "numpy") else values)


@pytest.mark.skipif(INSTALLED, reason="mujoco_warp is installed")
def test_without_warp_the_error_names_the_extra():
    with pytest.raises(ImportError, match=r'pip install "mjsense\[warp\]"'):
        simulation()


def test_options_of_warp_are_refused_on_the_cpu():
    with pytest.raises(ValueError, match="backend is 'gpu': must be one of cpu, warp"):
        simulation(backend="gpu")
    with pytest.raises(ValueError, match="njmax is for backend='warp'"):
        simulation(backend="cpu", njmax=3)
    assert [*inspect.signature(mjs.Simulation).parameters][:3] == ["scene", "num_worlds", "decimation"]


@needs_warp
def test_warp_is_imported_only_if_asked_for():
    code = "import sys, mjsense as mjs; mjs.Simulation(mjs.Scene(mjs.SceneCfg(base='<mujoco/>'))); assert not {'warp', 'mujoco_warp'} & {*sys.modules}"
    subprocess.run([sys.executable, "-c", code], check=True)


@needs_warp
def test_it_is_a_simulation():
    sim = simulation()
    assert isinstance(sim, mjs.Simulation)
    with pytest.raises(NotImplementedError, match=r"Simulation\.draw is not available with backend='warp'"):
        sim.draw


@needs_warp
@pytest.mark.parametrize(
    "scene", ["quadruped on a plane", "quadruped on rough terrain", "objects", "stones", "table with a Franka", "kitchen"]
)
def test_every_field_equals_that_of_the_cpu(scene):
    import warp_compare
    from warp_scenes import SCENES

    # With fewer worlds, one ray that grazes a thin capsule would be more than a thousandth of the values.
    assert not warp_compare.beyond(warp_compare.run("cpu", 8, 6, {scene: SCENES[scene]}))


@needs_warp
@pytest.mark.parametrize("scene", ["quadruped on a plane", "quadruped on a slope", "objects", "stones"])
def test_sensors_of_the_same_physics_are_equal_but_for_rounding(scene):
    import warp_compare
    from warp_scenes import SCENES

    assert not warp_compare.beyond(warp_compare.run_copied("cpu", 3, 3, {scene: SCENES[scene]}))


def fail():
    raise RuntimeError("the part has failed")


@needs_warp
def test_the_check_of_a_device_continues_after_parts_that_fail():
    import os
    import time

    from gpu_check import Part, run_parts

    parts = [
        Part("adds", divmod, (7, 2)),
        Part("fails", fail, ()),
        Part("crashes", os._exit, (3,)),
        Part("hangs", time.sleep, (60,)),
    ]
    results, failed = run_parts([*parts, Part("adds again", divmod, (9, 2))], seconds=60, longest=10)
    assert results == {"adds": (3, 1), "adds again": (4, 1)}
    assert "the part has failed" in failed["fails"] and "code 3" in failed["crashes"] and failed["hangs"] == "ended after 10 s"
    assert run_parts(parts[:1], seconds=0) == ({}, {"adds": "no time was left"})


@needs_warp
def test_air_time_and_history_over_many_steps():
    import warp_compare
    from warp_scenes import SceneOfCheck, feet_only

    reference, ours = warp_compare.pair(SceneOfCheck(feet_only), 2, "cpu")
    for _ in warp_compare.steps(reference, ours, 150):
        for name, field in reference.scene["feet"].fields.items():
            if not name.startswith(("force", "torque", "friction", "normal_force")):
                np.testing.assert_allclose(host(ours.scene["feet"].fields[name]), field, atol=1e-5, err_msg=name)
    assert reference.scene["feet"].data.last_air_time.max() > 0


@needs_warp
@pytest.mark.parametrize("scene", ["quadruped on a plane", "objects", "stones"])
def test_the_graph_of_a_step_computes_what_the_step_computes(scene):
    """Warp captures graphs on its CPU device as well, and they are replayed with the arrays and numbers of the capture."""
    import warp_compare
    from warp_scenes import SCENES

    plain, graph = (warp_compare.pair(SCENES[scene], 2, "cpu", reference=False)[1] for _ in range(2))
    graph._graphs.enabled = True
    key = "init_state" if plain.model.nkey else None
    for sim in (plain, graph):
        sim.reset(key=key, seed=3)
        for sensor in sim.scene.sensors.values():
            sensor.fields
    rng = np.random.default_rng(0)
    for step in range(7):
        ctrl = rng.normal(size=plain.ctrl.shape)
        for sim in (plain, graph):
            if step == 5:
                sim.reset([1], key=key)
            sim.ctrl = ctrl
            sim.step()
        for name, sensor in plain.scene.sensors.items():
            for field, values in sensor.fields.items():
                np.testing.assert_array_equal(host(graph.scene[name].fields[field]), host(values), err_msg=f"{name} {field}")
    assert graph._graphs._graphs["step"] is not None


@needs_warp
def test_sensors_belong_to_the_current_state():
    sim = simulation(decimation=4)
    data = mujoco.MjData(sim.model)
    sim.ctrl = [[0.1], [0.2], [0.3]]
    for _ in range(3):
        sim.step()
    with pytest.raises(ValueError, match=r"ctrl: shape \(2, 5\) does not broadcast to \(3, 1\)"):
        sim.ctrl = np.zeros((2, 5))
    sim.ctrl = 7.0  # for the next step only
    for world in range(3):
        data.qpos[:], data.qvel[:], data.ctrl[:] = host(sim.qpos)[world], host(sim.qvel)[world], 0.1 * (world + 1)
        mujoco.mj_forward(sim.model, data)
        for name in ("acc", "gyro", "angle", "force"):
            np.testing.assert_allclose(host(sim.scene[name].data)[world], data.sensor(name).data, atol=2e-5, err_msg=name)
        np.testing.assert_allclose(host(sim.data.xpos)[world], data.xpos, atol=1e-6)
    np.testing.assert_array_equal(host(sim.time), 3 * 4 * 0.005)


@needs_warp
def test_a_reset_concerns_only_its_worlds():
    sim = simulation(touch(track_air_time=True, history_length=2))
    for _ in range(5):
        sim.step()
    before = {name: host(field) for name, field in sim.scene["touch"].fields.items()}
    qpos = host(sim.qpos)
    sim.reset([1], key="low")
    assert host(sim.time).tolist() == [0.025, 0.0, 0.025]
    np.testing.assert_allclose(host(sim.qpos)[1], sim.model.key("low").qpos, rtol=1e-7)
    np.testing.assert_array_equal(host(sim.qpos)[[0, 2]], qpos[[0, 2]])
    after = sim.scene["touch"].fields
    assert host(after["current_contact_time"])[1].tolist() == [0, 0] and before["current_contact_time"][1, 1] > 0
    for name, field in before.items():
        np.testing.assert_array_equal(host(after[name])[[0, 2]], field[[0, 2]], err_msg=name)
    mask = np.array([True, False, True])
    sim.reset(mask)
    assert host(sim.time).tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match=r"world id 3: must be in \[0, 3\)"):
        sim.reset([3])


@pytest.mark.parametrize("backend", ["cpu", pytest.param("warp", marks=needs_warp)])
def test_a_written_time_is_the_simulations_and_the_physics_and_does_not_disturb_sensors(backend):
    xml = XML.replace("<sensor>", '<sensor><clock name="clock"/>').replace('<key name="low"', '<key name="low" time="1.5"')
    slow = mjs.CameraSensorCfg("eye", pos=(0, 0, 3), width=4, height=4, data_types=("depth",), update_period=0.015)
    sensors = slow, touch(track_air_time=True, history_length=3)
    sim, alone = (simulation(*sensors, xml=xml, backend=backend) for _ in range(2))
    for step in range(12):
        for other in (sim, alone):
            other.step()
        if step == 2:
            sim.set_state([1], time=5)
            np.testing.assert_allclose(host(sim.time), [0.015, 5, 0.015])
        if step == 6:
            sim.set_state(time=host(sim.time) - 1)
        for name in ("eye", "touch"):
            for field, values in alone.scene[name].fields.items():
                np.testing.assert_array_equal(host(sim.scene[name].fields[field]), host(values), err_msg=f"{step} {field}")
    np.testing.assert_allclose(host(sim.time), [-0.94, 4.045, -0.94])
    np.testing.assert_allclose(host(sim.scene["clock"].data)[:, 0], host(sim.time), rtol=1e-6)
    with pytest.raises(ValueError, match=r"time: shape \(2,\) is neither \(3,\) nor \(\)"):
        sim.set_state(time=[1, 2])
    sim.reset([0])
    sim.reset([1], key="low")
    np.testing.assert_allclose(host(sim.time), [0, 1.5, -0.94])


@needs_warp
def test_a_world_with_invalid_numbers_is_reset_and_the_others_continue():
    sim, alone = simulation(touch()), simulation(touch())
    for other in (sim, alone):
        other.step(3)
    sim.ctrl = [[0.0], [np.nan], [0.0]]
    alone.ctrl = 0.0
    for other in (sim, alone):
        other.step()
    ((world, reason),) = sim.failures
    assert world == 1 and "ctrl" in reason and "reset" in reason
    assert host(sim.time).tolist() == [0.02, 0.0, 0.02]
    np.testing.assert_array_equal(host(sim.qpos)[[0, 2]], host(alone.qpos)[[0, 2]])
    np.testing.assert_allclose(host(sim.qpos)[1], sim.model.qpos0, rtol=1e-7)
    sim.set_state([2], qpos=np.full(sim.model.nq, np.inf))
    assert [world for world, _ in sim.failures] == [2] and np.isfinite(host(sim.qpos)).all()
    sim.step()
    assert not sim.failures and np.isfinite(host(sim.scene["acc"].data)).all()


@needs_warp
def test_too_many_contacts_are_an_error_that_names_the_limit():
    with pytest.raises(RuntimeError, match=r"world \d has \d+ constraint rows, and njmax is 2: .* njmax=\d+ or more"):
        simulation(njmax=2, nconmax=20)
    with pytest.raises(RuntimeError, match=r"nconmax is 1 .* Make the simulation with nconmax=\d+ or more"):
        simulation(njmax=100, nconmax=1)


@needs_warp
def test_a_step_after_an_unannounced_write_is_an_error():
    sim = simulation()
    lifted = host(sim.qpos) + [[0], [0.5], [0]] * np.eye(1, sim.model.nq, 2)
    sim.qpos = lifted
    with pytest.raises(RuntimeError, match=r"world 1 were written without a forward\(\)"):
        sim.step()
    sim.qpos = lifted
    sim.forward()
    sim.step()
    with pytest.raises(ValueError, match="qpos: shape"):
        sim.set_state(qpos=np.zeros(2))


@needs_warp
def test_worlds_can_differ_in_the_model():
    values = {"body_mass": np.random.default_rng(0).uniform(0.5, 2, (3, 5)), "geom_friction": np.full((3, 5, 3), 0.3)}
    sims = simulation(touch()), simulation(touch(), backend="cpu")
    for sim in sims:
        for field, value in values.items():
            sim.randomize(
                field, np.broadcast_to(value[:, : len(getattr(sim.model, field))], (3, *getattr(sim.model, field).shape))
            )
        for _ in range(20):
            sim.step()
    np.testing.assert_allclose(host(sims[0].qpos), sims[1].qpos, atol=1e-5)
    np.testing.assert_allclose(host(sims[0].scene["touch"].data.force), sims[1].scene["touch"].data.force, atol=1e-2)
    with pytest.raises(ValueError, match="body_mass: values must be finite"):
        sims[0].randomize("body_mass", np.nan)
    with pytest.raises(ValueError, match="geom_condim: not a field of the model that can differ"):
        sims[0].randomize("geom_condim", 3)


@needs_warp
def test_arrays_share_the_device_memory():
    sim = simulation(touch())
    array = sim.scene["touch"].data.force
    found = np.from_dlpack(array)
    sim.step()
    assert sim.scene["touch"].data.force is array
    assert found.ctypes.data == (array.data_ptr() if hasattr(array, "data_ptr") else array.ptr)


@needs_warp
def test_read_only_values_are_copied():
    torch = pytest.importorskip("torch")
    sim = simulation()
    values = np.full(1, 0.5, np.float32)
    values.flags.writeable = False
    torch.set_warn_always(True)  # torch warns once in a process otherwise
    try:
        sim.ctrl = values
    finally:
        torch.set_warn_always(False)
    np.testing.assert_array_equal(host(sim.ctrl), np.full((sim.num_worlds, 1), 0.5))


@needs_warp
def test_code_of_the_pages():
    """The page itself, and mjlab's page on either backend, changed by one argument."""
    docs = Path(__file__).parents[2] / "docs"

    def blocks(page):
        return re.findall(r"^```python\n(.*?)^```$", (docs / page).read_text(), re.MULTILINE | re.DOTALL)

    page = {}
    first, training = blocks("warp.md")
    exec(first, page)
    assert host(page["scene"]["feet"].data.force).shape == (16, 4, 3)
    pytest.importorskip("torch")
    exec(training, page)
    assert page["reward"].shape == (16,)
    read = []
    for backend in ("cpu", "warp"):
        names, values = {}, []
        for block in blocks("mjlab.md"):
            exec(block.replace("model=scene.compile()", f"model=scene.compile(), backend='{backend}'"), names)
            data = {name: sensor.data for name, sensor in names["scene"].sensors.items()}
            if "eye" in data:
                values += [data["terrain_scan"].distances, data["feet_ground_contact"].force, data["eye"].depth]
            else:
                values.append(data["height"])
        read.append([host(value) for value in values])
    assert len(read[0]) == 4
    for theirs, ours in zip(*read, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-4)


class Height(mjs.Sensor):
    """Height of the ball, and the number of control steps of the episode."""

    uuid = "height"
    observation_space = gymnasium.spaces.Box(0, 10, (1,), np.float32)

    def initialize(self, sim):
        self.steps = np.zeros(sim.num_worlds, int)

    def update(self, dt):
        self.steps += 1

    def reset(self, world_ids=None):
        self.steps[slice(None) if world_ids is None else world_ids] = 0

    def compute(self, sim):
        height = sim.qpos[:, 2:3]
        return height.astype(np.float32) if isinstance(height, np.ndarray) else height


@needs_warp
def test_sensors_written_in_python_are_functions_of_device_arrays():
    sensor = Height()
    sim = simulation(sensor)
    sim.step(2)
    np.testing.assert_array_equal(host(sim.scene["height"].data), host(sim.qpos)[:, 2:3])
    sim.reset([0])
    assert sensor.steps.tolist() == [0, 2, 2]
    noisy = mjs.EffectSensorCfg("noisy", "gyro", effects=(mjs.effects.Noise(0.5),))
    sim = simulation(noisy)
    np.testing.assert_allclose(host(sim.scene["noisy"].data), host(sim.scene["gyro"].data) + 0.5)


@needs_warp
def test_what_is_missing_is_a_clear_error():
    with pytest.raises(ValueError, match="device 'cuda:7': there is no such device; there are cpu"):
        simulation(device="cuda:7")
    with pytest.raises(TypeError, match=r"Simulation\(\): device must be a str or None, not 3"):
        simulation(device=3)
    plugin = XML.replace("<sensor>", '<sensor><framepos name="late" objtype="geom" objname="ball" nsample="2" delay="0.01"/>')
    with pytest.raises(ValueError, match=r"sensor 'late': nsample = 2 is not available with backend='warp'"):
        simulation(xml=plugin)
    sim = simulation()
    with pytest.raises(NotImplementedError, match=r"Simulation.draw is not available with backend='warp'"):
        sim.draw(None)
    with pytest.raises(AttributeError, match="did you mean 'qpos'"):
        sim.qposs = 3
    sim.close()
    with pytest.raises(RuntimeError, match="closed"):
        sim.step()


@needs_warp
def test_a_recording_has_the_rows_of_the_device(tmp_path):
    eye = mjs.CameraSensorCfg(
        "eye", pos=(0, -2, 0.5), quat=(0.7071, 0.7071, 0, 0), width=32, height=24, data_types=("rgb", "depth")
    )
    sims = [simulation(touch(), Height(), eye, backend=backend) for backend in ("warp", "cpu")]
    rows = []
    for sim, out in zip(sims, ("warp", "cpu")):
        sensors = [sim.scene[name] for name in ("touch", "gyro", "height", "eye")]
        with mjs.Recorder(sim, tmp_path / out, sensors) as recorder:
            recorder.begin_episode(1, 0)
            for _ in range(4):
                recorder.append()
                sim.step()
            if out == "warp":
                last = host(sim.qpos)[1, 2]
            recorder.finish_episode(1)
        h5py = pytest.importorskip("h5py")
        with h5py.File(next((tmp_path / out).rglob("*.h5"))) as file:
            found = {}
            file.visititems(
                lambda name, item, found=found: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None
            )
        rows.append(found)
    assert rows[0].keys() == {name for name in rows[1] if name in rows[0]} and len(rows[0]) > 8
    heights = next(values for name, values in rows[0].items() if name.endswith("height"))
    assert heights.shape[0] == 4 and 0 < last < heights[0]
    for name, values in rows[0].items():
        if getattr(values, "dtype", np.dtype(bool)).kind == "f":
            np.testing.assert_allclose(values, rows[1][name], atol=1e-2, err_msg=name)


@needs_warp
def test_a_recorder_copies_the_rows_to_the_host_at_once(monkeypatch):
    import warp

    sim = simulation(touch(), Height())
    rows = sim._host_rows([sim.scene[name] for name in ("touch", "gyro", "height")])
    copied, read = [], []
    copy, numpy = warp.copy, warp.array.numpy
    monkeypatch.setattr(warp, "copy", lambda target, *options: (copied.append(target), copy(target, *options))[1])
    monkeypatch.setattr(warp.array, "numpy", lambda array: (read.append(array), numpy(array))[1])
    rows.read()
    assert len(rows.handles) > 3 and sum(target is rows._host for target in copied) == 1
    assert read == [rows._host]


@needs_warp
def test_suites_and_one_world():
    sim = simulation(touch(track_air_time=True))
    suite = mjs.SensorSuite([sim.scene["touch"], sim.scene["gyro"]])
    sim.step(30)
    assert suite.get_observations(sim)["gyro"].shape == (3, 3)
    one = suite.get_observations(sim, batch_index=1)["touch"]["force"]
    np.testing.assert_array_equal(host(one), host(sim.scene["touch"].data.force)[1])
    if hasattr(one, "clone"):
        found = sim.scene["touch"].data.current_contact_time
        np.testing.assert_array_equal(host(sim.scene["touch"].compute_first_contact(1.0)), host(found) > 0)
    with pytest.raises(NotImplementedError, match="view is not available"):
        mjs.view(sim)


@needs_warp
def test_noise_is_that_of_the_cpu_through_resets_and_failures():
    noisy = mjs.EffectSensorCfg(
        "noisy",
        "gyro",
        effects=(mjs.effects.EpisodeBias(mjs.effects.Gaussian(1.0)), mjs.effects.Noise(mjs.effects.Gaussian(1.0))),
    )
    sims = simulation(noisy, seed=7), simulation(noisy, seed=7, backend="cpu")

    def read():
        values = [host(sim.scene["noisy"].data) - host(sim.scene["gyro"].data) for sim in sims]
        np.testing.assert_allclose(values[0], values[1], atol=1e-5)
        return values[0]

    before = read()
    for sim in sims:
        sim.step(2)
    assert not np.allclose(read(), before)
    for action in (
        lambda sim: sim.reset([1]),
        lambda sim: sim.set_state([2], qpos=np.full(sim.model.nq, np.nan)),
        lambda sim: sim.step(),
    ):
        for sim in sims:
            action(sim)
        read()
    for sim in sims:
        sim.reset(seed=9)
    read()


@needs_warp
def test_options_of_a_running_simulation_are_for_the_cpu():
    xml = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=xml)), num_worlds=2, backend="warp", device="cpu")
    with pytest.raises(NotImplementedError, match=r"Simulation\.options is not available with backend='warp'; use backend='cpu'"):
        sim.options
    with pytest.raises(
        NotImplementedError, match=r"randomize\('opt\.gravity'\) is not available with backend='warp': set SceneCfg\(options="
    ):
        sim.randomize("opt.gravity", [0, 0, -1])
