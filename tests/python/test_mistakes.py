# SPDX-License-Identifier: Apache-2.0
"""Typical mistakes of users. Each message is one line that names the thing, what was found, what is expected, and the nearest name."""

import subprocess
import sys
from types import SimpleNamespace

import gymnasium
import mujoco
import numpy as np
import pytest
from tasks import Cart, Driver

import mjsense as mjs

XML = """
<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
  <body name="ball" pos="0 0 1"><freejoint name="root"/><geom name="skin" size=".1"/><site name="tip"/></body>
  <camera name="top" pos="0 0 3"/></worldbody><keyframe><key name="home"/></keyframe></mujoco>
"""


def scene_of(*sensors, **options):
    return mjs.Scene(mjs.SceneCfg(base=XML, sensors=sensors, **options))


@pytest.fixture(scope="module")
def sim():
    return mjs.Simulation(scene_of(mjs.ContactSensorCfg(name="feet", primary=mjs.ContactMatch("geom", "skin"))), num_worlds=2)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    out = tmp_path_factory.mktemp("data")
    mjs.record(task := Cart(), policy=Driver(task), out=out, num_worlds=1, episodes=1, keep_failures=True, cameras=[], seed=1, horizon=5)
    return mjs.Dataset(out)


class Misspelt(mjs.Task):
    def scene(self):
        return mjs.SceneCfg(base=XML)

    def evalute(self, sim):
        return {}


# What was written -> parts of the message. A case gets (sim, data, tmp_path).
CASES = {
    # keywords
    "config": (lambda u: mjs.CameraSensorCfg(name="c", hight=48), ["CameraSensorCfg()", "'hight'", "did you mean 'height'?"]),
    "config without a near name": (lambda u: mjs.ObjRef(xyzzy="a"), ["ObjRef()", "'xyzzy'", "it takes type, name, entity"]),
    "config in another case": (lambda u: mjs.SceneCfg(Sensors=()), ["SceneCfg()", "'Sensors'", "did you mean 'sensors'?"]),
    "effect": (lambda u: mjs.effects.Delay(delay=0.1), ["Delay()", "'delay'", "did you mean 'delay_s'"]),
    "mujoco options": (lambda u: mjs.MujocoCfg(time_step=0.01), ["MujocoCfg()", "'time_step'", "did you mean 'timestep'?"]),
    "terrain": (lambda u: mjs.TerrainCfg(dificulty=1), ["TerrainCfg()", "'dificulty'", "'difficulty'"]),
    "entity": (lambda u: mjs.EntityCfg(modle=XML), ["EntityCfg()", "'modle'", "did you mean 'model'?"]),
    "make_vec": (lambda u: mjs.make_vec("pick", num_env=2), ["make_vec()", "'num_env'", "did you mean 'num_envs'?"]),
    "make": (lambda u: mjs.make("pick", camera=[]), ["make_vec()", "'camera'", "'cameras'"]),
    "record": (lambda u: mjs.record("pick", out="x", episode=2), ["record()", "'episode'", "'episodes'"]),
    "Renderer": (lambda u: mjs.Renderer(u.model, heigth=3), ["Renderer()", "'heigth'", "did you mean 'height'?"]),
    "Dataset": (lambda u: mjs.Dataset("x", delta_timestamp={}), ["Dataset()", "'delta_timestamp'", "'delta_timestamps'"]),
    "export": (lambda u: mjs.exporting.export_lerobot("x", "y", succes=True), ["export_lerobot()", "'succes'", "did you mean 'success'?"]),
    "import": (lambda u: mjs.import_robomimic("x", out="y", fp=3), ["import_robomimic()", "'fp'", "did you mean 'fps'?"]),
    "attach": (lambda u: mjs.attach(1, 2, sensor=()), ["attach()", "'sensor'", "did you mean 'sensors'"]),
    "Simulation": (lambda u: mjs.Simulation(scene_of(), num_world=2), ["Simulation()", "'num_world'", "'num_worlds'"]),
    "Recorder": (lambda u: mjs.Recorder("x", u.sim, ovewrite=True), ["Recorder()", "'ovewrite'", "did you mean 'overwrite'?"]),
    "step": (lambda u: u.sim.step(controlsteps=2), ["Simulation.step()", "'controlsteps'", "did you mean 'control_steps'?"]),
    # words
    "image type in capitals": (lambda u: mjs.CameraSensorCfg(name="c", data_types=("RGB",)), ["camera 'c'", "data_types", "'RGB'", "did you mean 'rgb'?"]),
    "image type": (lambda u: mjs.CameraSensorCfg(name="c", data_types=("dept",)), ["camera 'c'", "'dept'", "did you mean 'depth'?"]),
    "contact field in capitals": (
        lambda u: mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "g"), fields=("Force",)),
        ["sensor 'f'", "fields is 'Force'", "did you mean 'force'?"],
    ),
    "reduce": (
        lambda u: mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "g"), reduce="maxfrce"),
        ["ContactSensorCfg 'f'", "reduce is 'maxfrce'", "'maxforce'"],
    ),
    "contact mode": (lambda u: mjs.ContactMatch("geoms", "g"), ["mode is 'geoms'", "must be one of", "'geom'"]),
    "reference": (lambda u: mjs.ObjRef("sites", "tip"), ["ObjRef", "'sites'", "did you mean 'site'?"]),
    "integrator": (lambda u: mjs.MujocoCfg(integrator="implcit"), ["integrator is 'implcit'", "'implicit'"]),
    "flag": (lambda u: mjs.Scene(mjs.SceneCfg(base=XML, options=mjs.MujocoCfg(disableflags=("gravty",)))), ["disableflags", "'gravty'", "did you mean 'gravity'?"]),
    "task": (lambda u: mjs.make_vec("pikc"), ["'pikc'", "did you mean 'pick'"]),
    "robot": (lambda u: mjs.make_vec("pick", "frank"), ["'frank'", "'franka'"]),
    "planner": (lambda u: mjs.make_vec("pick", policy="plannr"), ["'plannr'", "did you mean 'planner'?"]),
    # names of the model
    "site": (lambda u: mjs.Simulation(scene_of(mjs.ImuSensorCfg(name="i", site=mjs.ObjRef("site", "tp")))), ["sensor 'i'", "site", "'tp'", "did you mean 'tip'?"]),
    "camera": (lambda u: mjs.Simulation(scene_of(mjs.CameraSensorCfg(name="c", camera_name="tpo"))), ["camera 'c'", "'tpo'", "did you mean 'top'?"]),
    "geom": (
        lambda u: mjs.Simulation(scene_of(mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "sking")))),
        ["sensor 'f'", "primary", "'sking'", "'skin'"],
    ),
    "entity of an attached sensor": (
        lambda u: mjs.attach(u.model, u.state, sensors=(mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "skin", "robot")),)),
        ["sensor 'f'", "entity 'robot' not found", "leave out entity"],
    ),
    "sensor": (lambda u: u.sim.scene["fet"], ["no sensor or entity named 'fet'", "did you mean 'feet'?"]),
    "sensor field": (lambda u: u.sim.scene["feet"].data.forces, ["'forces'", "did you mean 'force'"]),
    "field of mjData": (lambda u: u.sim.data.xposs, ["'xposs'", "did you mean 'xpos'?"]),
    "field of mjModel": (lambda u: u.sim.randomize("geom_frction", 1), ["'geom_frction'", "did you mean 'geom_friction'"]),
    "option": (lambda u: setattr(u.sim.options, "gravty", 0), ["sim.options", "'gravty'", "did you mean 'gravity'?"]),
    "attribute": (lambda u: setattr(u.sim, "qposs", 0), ["Simulation", "'qposs'", "did you mean 'qpos'?"]),
    "keyframe": (lambda u: u.sim.reset(key="hom"), ["keyframe 'hom'", "'home'"]),
    # values
    "num_envs": (lambda u: mjs.make_vec("pick", num_envs=0), ["make_vec()", "num_envs is 0", "at least 1"]),
    "num_worlds": (lambda u: mjs.Simulation(scene_of(), num_worlds=0), ["num_worlds is 0", "at least 1"]),
    "world id": (lambda u: u.sim.reset([5]), ["world", "5", "2"]),
    "shape": (lambda u: u.sim.set_state(qpos=np.zeros(3)), ["qpos", "shape (3,)", "(2, 7)"]),
    "no number": (lambda u: u.sim.randomize("body_mass", "heavy"), ["body_mass", "'heavy'", "numbers"]),
    "write to sim.model": (lambda u: setattr(u.sim.model.opt, "gravity", [0, 0, -1]), ["read-only", "'opt.gravity'", "sim.options.gravity"]),
    "write to an element": (lambda u: setattr(u.sim.model.body("ball"), "mass", 1), ["read-only", "'body_mass'", "sim.randomize('body_mass', values)"]),
    # order of calls
    "append without begin_episode": (lambda u: mjs.Recorder(u.tmp / "r", u.sim, []).append(), ["append", "no world records an episode", "begin_episode("]),
    "task without evaluate": (lambda u: mjs.make_vec(Misspelt()), ["Misspelt", "no method evaluate(sim)", "'evalute'"]),
    "scene used twice": (lambda u: mjs.Simulation(u.sim.scene), ["this scene belongs to a simulation already", "Scene(scene.cfg)"]),
    # recordings
    "stream of an observation": (lambda u: u.data[0]["rewrd"], ["the observation has no 'rewrd'", "did you mean 'rewards'"]),
    "stream of an episode": (lambda u: u.data.episodes[0]["rewrds"], ["no stream 'rewrds'", "did you mean 'rewards'?"]),
    "stream of a dataset": (lambda u: mjs.Dataset(u.data.root, streams=["rewrds"]), ["'rewrds'", "did you mean 'rewards'"]),
    "time between observations": (
        lambda u: mjs.Dataset(u.data.root, delta_timestamps={"rewards": [0.001]}),
        ["delta_timestamps['rewards']", "0.001 s is not a multiple of 1/fps = 0.020000 s", "such as 1 / dataset.fps = 0.020000 s"],
    ),
    "folder": (lambda u: mjs.Dataset(u.tmp / "nothing"), ["nothing", "no such file or directory"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_message(case, sim, data, tmp_path):
    model = mujoco.MjModel.from_xml_string(XML)
    mistake, parts = CASES[case]
    with pytest.raises((AttributeError, KeyError, OSError, RuntimeError, TypeError, ValueError)) as error:
        mistake(SimpleNamespace(sim=sim, data=data, tmp=tmp_path, model=model, state=mujoco.MjData(model)))
    message = str(error.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_there_are_enough():
    assert len(CASES) > 50


def test_attached_sensors_that_are_behind_warn_once():
    model = mujoco.MjModel.from_xml_string(XML)
    state = mujoco.MjData(model)
    attached = mjs.attach(model, state, sensors=(mjs.ImuSensorCfg(name="i", site=mjs.ObjRef("site", "tip")),))
    attached["i"].data
    mujoco.mj_step(model, state)
    with pytest.warns(RuntimeWarning, match=r"attached sensors show data\[0\] at 0 s, and it is at 0\.002 s: call update\(\) after mj_step") as found:
        attached["i"].data
        attached["i"].data
    assert len(found) == 1 and found[0].filename == __file__
    attached.update()
    attached["i"].data


def test_an_environment_that_has_ended_asks_for_a_reset():
    env = mjs.make(Cart(), cameras=[], horizon=2)
    env.reset(seed=0)
    action = np.zeros(env.action_space.shape)
    while not (ended := env.step(action)[2:4])[0] and not ended[1]:
        pass
    for step in (env.step, lambda action: env.step_chunk(action[None])):
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"\(\): the episode has ended \((terminated|truncated)\): call reset\(\) first"):
            step(action)
    env.reset()
    env.step(action)


@pytest.mark.parametrize("words", [["help"], ["help", "record"], ["help", "export"]])
def test_help_is_a_command(words):
    found, expected = (subprocess.run([sys.executable, "-m", "mjsense", *given], capture_output=True, text=True) for given in (words, [*words[1:], "--help"]))
    assert found.returncode == expected.returncode == 0
    assert found.stdout == expected.stdout != ""


def test_another_mujoco_warp_is_named(monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda name: "3.11.0")
    with pytest.raises(ImportError, match=r"backend='warp' needs mujoco-warp 4\.0, and 3\.11\.0 is installed.*pip install \"mjsense\[warp\]\""):
        mjs.Simulation(scene_of(), backend="warp")
