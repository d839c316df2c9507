# SPDX-License-Identifier: Apache-2.0
"""Physics options of running simulations: against analytic values and, bit for bit, against plain MuJoCo; models that refuse writes."""

import copy
import json
import os
import pickle
import subprocess
import sys

import h5py
import numpy as np
import pytest
from program_runs import run_program
from tasks import Cart, Driver

import mjsense as mjs
from mjsense.core import libmujoco, mujoco_views
from mjsense.dataset import sensor_check
from mjsense.dataset.model_xml import model_xml
from mjsense.scene import physics_options

WORLD = """
<mujoco><option timestep=".002" density="1.2"/><worldbody><light name="l" pos="0 0 3"/><camera name="c" pos="0 -2 1" xyaxes="1 0 0 0 .4 .9"/>
  <geom name="f" type="plane" size="3 3 1"/>
  <body name="b" pos="0 0 1"><freejoint/><geom name="g" size=".1"/><site name="s"/></body>
  <body name="box" pos="1 0 .12" euler="3 2 1"><freejoint/><geom type="box" size=".1 .1 .1" condim="4"/></body>
  <body name="arm" pos="-1 0 1"><joint name="h" axis="0 1 0" damping=".1" stiffness="1" range="-1 1" frictionloss=".01"/>
    <geom type="capsule" size=".05" fromto="0 0 0 .4 0 0"/><site name="tip" pos=".4 0 0"/></body>
</worldbody>
<actuator><position name="a" joint="h" kp="3" group="1"/></actuator>
<sensor><accelerometer name="acc" site="s"/><magnetometer name="mag" site="tip"/></sensor></mujoco>
"""


def simulation(num_worlds=1, xml=WORLD, threads=1, sensors=(), **options):
    return mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=xml, sensors=sensors)), num_worlds, threads=threads, **options)


def test_free_fall_under_each_world_s_gravity():
    sim = simulation(5, WORLD.replace('density="1.2"', ""))
    g = -np.array([0.0, 1.62, 3.71, 9.81, 24.79])
    sim.randomize("opt.gravity", np.stack([0 * g, 0 * g, g], axis=1))
    sim.step(100)
    h = sim.physics_dt
    # The semi-implicit Euler integrator: v_n = n g h, z_n = z_0 + g h^2 n (n + 1) / 2.
    np.testing.assert_allclose(sim.qvel[:, 2], 100 * g * h, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(sim.qpos[:, 2], 1 + g * h * h * 100 * 101 / 2, rtol=1e-12)
    np.testing.assert_allclose(sim.scene["acc"].data, 0, atol=1e-6)  # in free fall


def test_an_accelerometer_at_rest_reads_the_gravity_of_its_world():
    sim = simulation(2, WORLD.replace("<freejoint/><geom name=\"g\"", "<geom name=\"g\""))
    sim.options.gravity = [[0, 0, -9.81], [0, 0, -1.62]]
    np.testing.assert_allclose(sim.scene["acc"].data, [[0, 0, 9.81], [0, 0, 1.62]], rtol=1e-6)


VALUES = {
    "gravity": [[0, 0, -9.81], [1, 2, -3], [0, 0, 0]], "wind": [[0, 0, 0], [5, 0, 0], [0, -3, 1]],
    "magnetic": [[0, -0.5, 0], [1, 0, 0], [0, 0, 2]], "density": [0, 1.2, 1000], "viscosity": [0, 0.1, 1], "impratio": [1, 5, 10],
    "integrator": [0, 1, 3], "cone": [0, 1, 1], "jacobian": [0, 1, 2], "solver": [0, 1, 2], "iterations": [100, 1, 3],
    "tolerance": [1e-8, 0, 1e-2], "ls_iterations": [50, 1, 2], "ls_tolerance": [0.01, 0.5, 0.001], "noslip_iterations": [0, 3, 10],
    "noslip_tolerance": [1e-6, 0, 1], "ccd_iterations": [50, 2, 20], "ccd_tolerance": [1e-6, 1e-2, 0], "sdf_initpoints": [40, 4, 2],
    "sdf_iterations": [10, 1, 3], "sleep_tolerance": [1e-4, 0, 1], "o_margin": [0, 0.01, 0.1],
    "o_solref": [[0.02, 1], [0.05, 1], [0.1, 0.5]], "o_solimp": [[0.9, 0.95, 0.001, 0.5, 2], [0.5, 0.9, 0.01, 0.5, 2], [0.1, 0.9, 0.02, 0.5, 1]],
    "o_friction": [[1, 1, 0.005, 0.0001, 0.0001], [0.1, 0.1, 0, 0, 0], [2, 1, 0.1, 0, 0]], "disableflags": [0, 1 << 4, 1 << 7 | 1 << 6],
    "enableflags": [0, 1, 2], "disableactuator": [0, 2, 1],
}  # fmt: skip


def test_every_option_is_tested():
    assert {"timestep", *VALUES} == set(physics_options.names())


@pytest.mark.skipif(libmujoco.shared is None, reason="needs a mujoco of the series")
@pytest.mark.parametrize("name", VALUES)
def test_worlds_with_other_options_equal_plain_mujoco(name):
    import mujoco

    xml = WORLD
    if name == "magnetic":
        xml = xml.replace("<freejoint/>", "", 1)
    if name.startswith("o_"):
        xml = xml.replace('<option timestep=".002" density="1.2"/>', '<option timestep=".002"><flag override="enable"/></option>')
    sims = [simulation(3, xml, threads) for threads in (1, 3)]
    for sim in sims:
        sim.ctrl[:] = 1
        sim.step(3)
        sim.randomize(f"opt.{name}", np.array(VALUES[name]))
        sim.step(80)
    assert sims[0].state.tobytes() == sims[1].state.tobytes()
    found = []
    for world, value in enumerate(VALUES[name]):
        model = copy.copy(sims[0].model)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        data.ctrl[:] = 1
        mujoco.mj_step(model, data, 3)
        setattr(model.opt, name, value)
        mujoco.mj_step(model, data, 80)
        state = np.empty(sims[0].state.shape[1])
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        assert state.tobytes() == sims[0].state[world].tobytes(), f"world {world}"
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(sims[0].data.sensordata[world], data.sensordata)
        assert np.array_equal(getattr(sims[0].model_of(world).opt, name), getattr(model.opt, name))
        found.append((state.tobytes(), data.sensordata.tobytes()))
    if name not in ("sleep_tolerance", "ccd_iterations", "ccd_tolerance", "sdf_initpoints", "sdf_iterations", "noslip_tolerance", "jacobian",
                    "tolerance", "ls_iterations", "ls_tolerance", "enableflags"):  # fmt: skip
        assert len(set(found)) > 1, "the option has no effect here"


def test_words_for_flags_and_enumerations():
    sim = simulation(2)
    sim.options.disableflags = ("gravity", "contact")
    assert sim.options.disableflags.tolist() == [1 << 4 | 1 << 7] * 2
    before = sim.qpos.copy()
    sim.step(10)
    np.testing.assert_array_equal(sim.qpos[:, :7], before[:, :7])
    sim.options.disableflags = ()
    sim.options.integrator = "rk4"
    sim.options.cone = "elliptic"
    assert sim.options.integrator.tolist() == [1, 1] and sim.options.cone.tolist() == [1, 1]
    sim.step()
    assert (sim.qvel[:, 2] < 0).all()


def test_options_stay_after_a_reset_and_follow_world_ids():
    sim = simulation(3)
    sim.randomize("opt.gravity", [0, 0, -1], world_ids=[1])
    sim.reset()
    assert sim.options.gravity[:, 2].tolist() == [-9.81, -1, -9.81]
    assert not sim.options.gravity.flags.writeable
    sim.step()
    np.testing.assert_allclose(sim.qvel[:, 2], np.array([-9.81, -1, -9.81]) * 0.002, rtol=1e-12)


@pytest.mark.parametrize("timestep", [0.001, 0.004])
def test_timestep(timestep):
    sim, other = simulation(2, decimation=5), simulation(2, WORLD.replace('".002"', f'"{timestep}"'), decimation=5)
    sim.step(3)
    with pytest.raises(ValueError, match=r"timestep: world 0 is at 0\.03 s of its episode.*call reset\(\) first"):
        sim.options.timestep = timestep
    sim.reset()
    sim.options.timestep = timestep
    assert (sim.physics_dt, sim.step_dt, sim.model.opt.timestep) == (timestep, other.step_dt, timestep)
    for _ in range(20):
        sim.step()
        other.step()
    assert sim.state.tobytes() == other.state.tobytes()
    np.testing.assert_array_equal(sim.time, other.time)


def test_timestep_of_sensors_that_count_steps():
    delayed = mjs.EffectSensorCfg(name="d", sensor="acc", effects=(mjs.effects.Delay(delay_s=0.004),))
    sim = simulation(1, sensors=(delayed,))
    with pytest.raises(ValueError, match=r"timestep: the noise, delays, ray times or exposures of sensor 'd' are in steps of 0\.002 s: set SceneCfg\(options="):
        sim.options.timestep = 0.001
    assert sim.options.timestep == 0.002
    site = mjs.ObjRef("site", "s")
    simulation(1, sensors=(mjs.ImuSensorCfg(name="imu", site=site),)).options.timestep = 0.001  # an ideal one counts no steps
    with pytest.raises(ValueError, match="of sensor 'imu' are in steps"):
        simulation(1, sensors=(mjs.ImuSensorCfg(name="imu", site=site, preset="mpu6050"),)).options.timestep = 0.001


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda sim: setattr(sim.options, "gravty", (0, 0, 0)), "sim.options has no option 'gravty'; did you mean 'gravity'?"),
        (lambda sim: sim.options.gravty, "sim.options has no option 'gravty'; did you mean 'gravity'?"),
        (lambda sim: sim.randomize("opt.gravty", 0), "MuJoCo has no option 'gravty'; did you mean 'gravity'?"),
        (lambda sim: sim.randomize("opt.timestep", 0.1), "opt.timestep: the same in all worlds; set sim.options.timestep"),
        (lambda sim: setattr(sim.options, "timestep", -1), "timestep is -1: must be a positive number of seconds"),
        (lambda sim: setattr(sim.options, "gravity", (0, 1)), r"opt.gravity: shape (2,) does not broadcast to (2, 3)"),
        (lambda sim: setattr(sim.options, "gravity", (0, 0, np.nan)), "opt.gravity: values must be finite"),
        (lambda sim: setattr(sim.options, "gravity", "down"), "opt.gravity: values must be numbers, not 'down'"),
        (lambda sim: setattr(sim.options, "density", -1), "opt.density: values must be at least 0; one is -1"),
        (lambda sim: setattr(sim.options, "impratio", 0), "opt.impratio: values must be positive; one is 0"),
        (lambda sim: setattr(sim.options, "iterations", 0), "opt.iterations: values must be at least 1; one is 0"),
        (lambda sim: setattr(sim.options, "iterations", 2.5), "opt.iterations: values must be integers, not 2.5"),
        (lambda sim: setattr(sim.options, "solver", 3), "opt.solver: values must be 0 to 2 (pgs, cg, newton), not 3"),
        (lambda sim: setattr(sim.options, "solver", "newtn"), "opt.solver: no value 'newtn'; did you mean 'newton'?"),
        (lambda sim: setattr(sim.options, "disableflags", ("gravty",)), "opt.disableflags: no value 'gravty'; did you mean 'gravity'?"),
        (lambda sim: setattr(sim.options, "disableflags", 1 << 30), "opt.disableflags: values must be 0 to"),
        (lambda sim: setattr(sim.options, "enableflags", "sleep"), "opt.enableflags: 'sleep' cannot change in a simulation; set it before the scene is compiled"),
    ],
)  # fmt: skip
def test_wrong_values(write, message):
    sim = simulation(2)
    before = sim.state.tobytes()
    with pytest.raises((ValueError, AttributeError)) as error:
        write(sim)
    assert message in str(error.value)
    sim.step()
    other = simulation(2)
    assert other.state.tobytes() == before
    other.step()
    assert sim.state.tobytes() == other.state.tobytes()


WRITES = {
    "opt.gravity[2]": lambda m: m.opt.gravity.__setitem__(2, -1.6), "opt.gravity": lambda m: setattr(m.opt, "gravity", [0, 0, -1.6]),
    "opt.timestep": lambda m: setattr(m.opt, "timestep", 0.01), "opt.disableflags": lambda m: setattr(m.opt, "disableflags", 1),
    "opt.integrator": lambda m: setattr(m.opt, "integrator", 1), "opt.wind": lambda m: setattr(m.opt, "wind", [5, 0, 0]),
    "body_mass[1]": lambda m: m.body_mass.__setitem__(1, 50), "body_mass": lambda m: setattr(m, "body_mass", m.body_mass),
    "geom_rgba[0]": lambda m: m.geom_rgba.__setitem__(0, [1, 0, 0, 1]), "geom_rgba": lambda m: setattr(m.geom("g"), "rgba", [1, 0, 0, 1]),
    "geom_rgba[g]": lambda m: m.geom("g").rgba.__setitem__(0, 1), "vis.headlight.ambient[:]": lambda m: m.vis.headlight.ambient.fill(1),
    "vis.map.znear": lambda m: setattr(m.vis.map, "znear", 0.9), "stat.extent": lambda m: setattr(m.stat, "extent", 50.0),
    "cam_fovy[0]": lambda m: m.cam_fovy.__setitem__(0, 90), "cam_fovy": lambda m: setattr(m.camera(0), "fovy", 90),
    "light_active[0]": lambda m: m.light_active.__setitem__(0, 0), "qpos0[2]": lambda m: m.qpos0.__setitem__(2, 5),
    "nq": lambda m: setattr(m, "nq", 3), "jnt_range": lambda m: setattr(m.joint("h"), "range", [0, 1]),
}  # fmt: skip


@pytest.mark.parametrize("private", [False, True])
@pytest.mark.parametrize("name", WRITES)
def test_models_for_look_ups_refuse_writes(name, private, monkeypatch):
    if private:  # as without a mujoco of the series
        monkeypatch.setattr(libmujoco, "shared", None)
    sim = simulation()
    for model in (sim.model, sim.scene.model):
        assert private == isinstance(model, mujoco_views.MjModelView)
        before = model.body_mass.tobytes() + model.qpos0.tobytes() + model.geom_rgba.tobytes()
        with pytest.raises((AttributeError, ValueError)) as error:
            WRITES[name](model)
        if "[" not in name:
            assert f"the model is read-only, and a write to '{name}' would not reach the simulation: use " in str(error.value)
        else:
            assert "read-only" in str(error.value)
        assert model.body_mass.tobytes() + model.qpos0.tobytes() + model.geom_rgba.tobytes() == before
        own = copy.copy(model)
        own.opt.timestep, own.body_mass[1] = 0.01, 50
        assert (own.opt.timestep, own.body("b").mass[0]) == (0.01, 50)


@pytest.mark.skipif(libmujoco.shared is None, reason="needs a mujoco of the series")
def test_read_only_models_work_in_mujoco():
    import mujoco

    sim = simulation()
    model = sim.model
    assert isinstance(model, mujoco.MjModel) and isinstance(model.opt, mujoco.MjOption)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    sim.step()
    assert data.qpos.tobytes() == sim.qpos[0].tobytes()
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "g") == model.geom("g").id
    assert model.vis.global_.offwidth == 640 and "timestep" in dir(model.opt)
    own = pickle.loads(pickle.dumps(model))
    own.opt.timestep = 0.1
    world = sim.model_of(0)  # was not converted
    for name in dir(world):
        if isinstance(value := getattr(world, name), np.ndarray):
            np.testing.assert_array_equal(getattr(model, name), value, name)
            np.testing.assert_array_equal(getattr(own, name), value, name)


def test_model_field_of_options_is_live():
    sim = simulation(2)
    sim.model_field("opt.gravity")[1] = (0, 0, -1)
    sim.forward()
    assert sim.options.gravity[1].tolist() == [0, 0, -1]


class Moon(Cart):
    """Each episode has its own gravity and wind."""

    def initialize(self, sim):
        super().initialize(sim)
        sim.options.density = 1.2
        sim.options.wind = (3, 0, 0)

    def sample(self, rng, world):
        super().sample(rng, world)
        self.sim.randomize("opt.gravity", [0, 0, -rng.uniform(1, 20)], world_ids=[world.id])


class Storm(Moon):
    """The wind turns during the episode."""

    def evaluate(self, sim):
        if (sim.time > 0.1).any():
            sim.options.wind = (-3, 0, 0)
        return super().evaluate(sim)


RECORDING = {"num_worlds": 2, "episodes": 3, "keep_failures": True, "cameras": [], "seed": 3, "horizon": 12}


@pytest.fixture(scope="module")
def moon(tmp_path_factory):
    out = tmp_path_factory.mktemp("moon")
    mjs.record(task := Moon(), policy=Driver(task), out=out, **RECORDING)
    return out


def test_recorded_options_replay_equal(moon):
    dataset = mjs.Dataset(moon)
    models = [episode.model() for episode in dataset.episodes]
    assert len({model.opt.gravity[2] for model in models}) == 3
    assert all(model.opt.wind.tolist() == [3, 0, 0] and model.opt.density == 1.2 for model in models)
    with h5py.File(next(moon.glob("house_0/*.h5"))) as file:
        assert "changed" not in file["traj_0/replay"]
        assert file["traj_0/replay/model/opt.density"][:].tolist() == [1.2]
    assert mjs.check_replay(moon).ok
    for episode, t, data in mjs.replay(moon, from_="actions"):
        assert np.array_equal(data.qpos, episode.states[t][1 : 1 + len(data.qpos)])
    xml, assets = model_xml(dataset.episodes[1])
    import mujoco

    np.testing.assert_allclose(mujoco.MjModel.from_xml_string(xml, assets).opt.gravity, models[1].opt.gravity)


def test_recorded_options_replay_without_mujoco(moon):
    words = [sys.executable, "-m", "mjsense", "replay", moon, "--json"]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "MJSENSE_MUJOCO": "private"})
    assert done.returncode == 0 and json.loads(done.stdout)["ok"], done.stderr


def test_options_that_change_during_an_episode_are_named(tmp_path):
    mjs.record(task := Storm(), policy=Driver(task), out=tmp_path, **RECORDING)
    done = run_program("verify", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    report = mjs.check_replay(tmp_path)
    assert not report
    assert "cannot be simulated from its actions: opt.wind of the model changed during the episode" in repr(report)
    with pytest.raises(ValueError, match=r"cannot be simulated from its actions: opt\.wind of the model changed"):
        list(mjs.Dataset(tmp_path).episodes[0].replay("actions"))
    assert len(list(mjs.Dataset(tmp_path).episodes[0].replay("states"))) == 13


def test_built_in_tasks_do_not_change_the_model_during_an_episode(tmp_path):
    mjs.record("pick", out=tmp_path, **{**RECORDING, "cameras": ["wrist_camera"], "width": 32, "height": 24})
    with h5py.File(next(tmp_path.glob("house_0/*.h5"))) as file:
        assert all("changed" not in file[trajectory]["replay"] for trajectory in file)


class Light(mjs.Policy):
    """Sets an option in a built-in task, in every second episode."""

    observation = ("qpos",)

    def reset(self, world_ids):
        for world in world_ids:
            self.sim.randomize("opt.gravity", [0, 0, -5 if self._mjs_episodes[world] % 2 else -9.81], world_ids=[world])

    def act(self, obs):
        return {}


def test_options_that_a_policy_sets_in_a_built_in_task(tmp_path):
    mjs.record("pick", policy=Light(), out=tmp_path, **{**RECORDING, "num_worlds": 1})
    episodes = mjs.Dataset(tmp_path).episodes
    assert [episode.model().opt.gravity[2] for episode in episodes] == [-9.81, -5, -9.81]
    worlds = sensor_check._Rebuilt(episodes[0], 1, 1)
    for episode in episodes:  # the task is rebuilt without the policy
        worlds.begin(0, episode)
        assert worlds.sim.options.gravity[0, 2] == episode.model().opt.gravity[2]
    report = mjs.check_replay(tmp_path, states=True, num_worlds=1)
    assert report.ok, report
