# SPDX-License-Identifier: Apache-2.0
"""Typical mistakes of users. Each message is one line that names the thing, what was found, what is expected, and the nearest name."""

from types import SimpleNamespace

import gymnasium
import mujoco
import numpy as np
import pytest
from program_runs import run_program
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


def folder_with(folder, name):
    (folder / name).touch()
    return str(folder)


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
    "make": (lambda u: mjs.make("pick", camera=[]), ["make()", "'camera'", "'cameras'"]),
    "record": (lambda u: mjs.record("pick", out="x", episode=2), ["record()", "'episode'", "'episodes'"]),
    "Renderer": (lambda u: mjs.Renderer(u.model, heigth=3), ["Renderer()", "'heigth'", "did you mean 'height'?"]),
    "Dataset": (lambda u: mjs.Dataset("x", delta_timestamp={}), ["Dataset()", "'delta_timestamp'", "'delta_timestamps'"]),
    "export": (lambda u: mjs.exporting.export_lerobot("x", "y", succes=True), ["export_lerobot()", "'succes'", "did you mean 'success'?"]),
    "import": (lambda u: mjs.import_robomimic("x", out="y", fp=3), ["import_robomimic()", "'fp'", "did you mean 'fps'?"]),
    "attach": (lambda u: mjs.attach(1, 2, sensor=()), ["attach()", "'sensor'", "did you mean 'sensors'"]),
    "Simulation": (lambda u: mjs.Simulation(scene_of(), num_world=2), ["Simulation()", "'num_world'", "'num_worlds'"]),
    "Recorder": (lambda u: mjs.Recorder(u.sim, "x", ovewrite=True), ["Recorder()", "'ovewrite'", "did you mean 'overwrite'?"]),
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
    "append without begin_episode": (lambda u: mjs.Recorder(u.sim, u.tmp / "r", []).append(), ["append", "no world records an episode", "begin_episode("]),
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
    # values of configurations
    "size 0": (lambda u: mjs.CameraSensorCfg(name="c", width=0), ["camera 'c'", "width is 0", "between 1 and 16384"]),
    "text for a number": (lambda u: mjs.CameraSensorCfg(name="c", width="640"), ["CameraSensorCfg 'c'", "width", "an int", "'640'"]),
    "fraction of a pixel": (lambda u: mjs.CameraSensorCfg(name="c", height=64.5), ["CameraSensorCfg 'c'", "height", "an int", "64.5"]),
    "field of view": (lambda u: mjs.CameraSensorCfg(name="c", fovy=200), ["camera 'c'", "fovy is 200 degrees", "less than 180"]),
    "two coordinates": (lambda u: mjs.CameraSensorCfg(name="c", pos=(0, 1)), ["CameraSensorCfg 'c'", "pos", "3 numbers", "(0, 1)"]),
    "a coordinate is nan": (lambda u: mjs.CameraSensorCfg(name="c", pos=(0, 1, np.nan)), ["camera 'c'", "pos[2] is nan", "finite"]),
    "quaternion 0": (lambda u: mjs.CameraSensorCfg(name="c", quat=(0, 0, 0, 0)), ["camera 'c'", "quat is [0, 0, 0, 0]", "must not be 0"]),
    "no image": (lambda u: mjs.CameraSensorCfg(name="c", data_types=()), ["camera 'c'", "data_types is empty", "rgb, depth"]),
    "an image twice": (lambda u: mjs.CameraSensorCfg(name="c", data_types=("rgb", "rgb")), ["camera 'c'", "data_types", "'rgb' twice"]),
    "no name": (lambda u: mjs.CameraSensorCfg(), ["CameraSensorCfg", "missing", "'name'"]),
    "near beyond far": (lambda u: mjs.CameraSensorCfg(name="c", near=2, far=1), ["camera 'c'", "near 2 and far 1", "0 <= near < far"]),
    "group 6": (lambda u: mjs.CameraSensorCfg(name="c", enabled_geom_groups=(6,)), ["camera 'c'", "enabled_geom_groups[0] is 6", "between 0 and 5"]),
    "samples": (lambda u: mjs.CameraSensorCfg(name="c", samples=0), ["camera 'c'", "samples is 0", "between 1 and 64"]),
    "kind of depth": (lambda u: mjs.CameraSensorCfg(name="c", depth_kind="plana"), ["depth_kind is 'plana'", "planar, ray", "did you mean 'planar'?"]),
    "noise without depth": (lambda u: mjs.CameraSensorCfg(name="c", depth_noise="d405"), ["camera 'c'", "depth_noise", "planar depth"]),
    "bool for a number": (lambda u: mjs.CameraSensorCfg(name="c", samples=True), ["CameraSensorCfg 'c'", "samples", "an int", "True"]),
    "text for a bool": (lambda u: mjs.CameraSensorCfg(name="c", use_shadows="yes"), ["CameraSensorCfg 'c'", "use_shadows", "a bool", "'yes'"]),
    "slots": (
        lambda u: mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "g"), num_slots=0),
        ["sensor 'f'", "num_slots is 0", "at least 1"],
    ),
    "text for a match": (lambda u: mjs.ContactSensorCfg(name="f", primary="skin"), ["ContactSensorCfg 'f'", "primary", "ContactMatch", "'skin'"]),
    "no primary": (lambda u: mjs.ContactSensorCfg(name="f"), ["ContactSensorCfg", "missing", "'primary'"]),
    "regular expression": (
        lambda u: mjs.Simulation(scene_of(mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "ski[n")))),
        ["sensor 'f'", "primary", "'ski[n'", "not a regular expression", "position 3"],
    ),
    "no contact fields": (
        lambda u: mjs.ContactSensorCfg(name="f", primary=mjs.ContactMatch("geom", "g"), fields=()),
        ["sensor 'f'", "fields is empty", "found, force"],
    ),
    "body of rays": (
        lambda u: mjs.Simulation(scene_of(mjs.RayCastSensorCfg(name="r", frame=mjs.ObjRef("body", "bal"), pattern=mjs.GridPatternCfg()))),
        ["sensor 'r'", "no body named 'bal'", "did you mean 'ball'?"],
    ),
    "text for a pattern": (
        lambda u: mjs.RayCastSensorCfg(name="r", frame=mjs.ObjRef("body", "ball"), pattern="grid"),
        ["RayCastSensorCfg 'r'", "pattern", "GridPatternCfg", "'grid'"],
    ),
    "a class for a pattern": (
        lambda u: mjs.RayCastSensorCfg(name="r", frame=mjs.ObjRef("body", "ball"), pattern=mjs.GridPatternCfg),
        ["RayCastSensorCfg 'r'", "pattern", "the class GridPatternCfg", "write GridPatternCfg(...)"],
    ),
    "a class for a reference": (
        lambda u: mjs.RayCastSensorCfg(name="r", frame=mjs.ObjRef),
        ["RayCastSensorCfg 'r'", "frame must be", "the class ObjRef", "write ObjRef(...)"],
    ),
    "text for a reference": (lambda u: mjs.RayCastSensorCfg(name="r", frame="ball"), ["RayCastSensorCfg 'r'", "frame", "ObjRef", "'ball'"]),
    "distance of rays": (
        lambda u: mjs.RayCastSensorCfg(name="r", frame=mjs.ObjRef("body", "ball"), max_distance=-1),
        ["sensor 'r'", "max_distance is -1", "above 0"],
    ),
    "resolution": (lambda u: mjs.GridPatternCfg(resolution=0), ["GridPatternCfg", "resolution is 0", "above 0"]),
    "kind of object": (lambda u: mjs.Simulation(scene_of(mjs.ImuSensorCfg(name="i", site=mjs.ObjRef("body", "tip")))), ["sensor 'i'", "needs a site", "body 'tip'"]),
    "a sensor twice": (lambda u: mjs.Simulation(scene_of(*[mjs.ImuSensorCfg(name="i", site=mjs.ObjRef("site", "tip"))] * 2)), ["sensor 'i'", "two sensors"]),
    "a class of sensors": (lambda u: scene_of(mjs.ImuSensorCfg), ["sensors", "sensor configuration", "ImuSensorCfg"]),
    "one sensor for many": (
        lambda u: mjs.SceneCfg(base=XML, sensors=mjs.ImuSensorCfg(name="i", site=mjs.ObjRef("site", "tip"))),
        ["SceneCfg", "sensors", "a sequence", "ImuSensorCfg(name='i'"],
    ),
    "timestep": (lambda u: mjs.MujocoCfg(timestep=0), ["MujocoCfg", "timestep is 0", "above 0"]),
    "gravity": (lambda u: mjs.MujocoCfg(gravity=(0, -9.81)), ["MujocoCfg", "gravity", "3 numbers", "(0, -9.81)"]),
    "iterations": (lambda u: mjs.MujocoCfg(iterations=-1), ["MujocoCfg", "iterations is -1", "at least 1"]),
    "solver": (lambda u: mjs.MujocoCfg(solver="newtn"), ["MujocoCfg", "solver is 'newtn'", "pgs, cg, newton", "did you mean 'newton'?"]),
    "cone": (lambda u: mjs.MujocoCfg(cone="eliptic"), ["MujocoCfg", "cone is 'eliptic'", "did you mean 'elliptic'?"]),
    "delay": (lambda u: mjs.effects.Delay(delay_s=-1), ["Delay", "delay_s is -1", "at least 0"]),
    "file of an entity": (lambda u: mjs.Scene(mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model="robot.xlm")})), ["entity 'robot'", "no file 'robot.xlm'"]),
    "file of a base": (lambda u: mjs.Scene(mjs.SceneCfg(base="nothing.xml")), ["'nothing.xml'", "file"]),
    "decimation": (lambda u: mjs.Simulation(scene_of(), decimation=0), ["decimation is 0", "at least 1"]),
    "threads": (lambda u: mjs.Simulation(scene_of(), threads=-1), ["threads is -1", "0 (all) to 4096"]),
    "backend": (lambda u: mjs.Simulation(scene_of(), backend="wrap"), ["Simulation()", "backend is 'wrap'", "cpu, warp", "did you mean 'warp'?"]),
    "name of the package": (lambda u: mjs.CameraSensorConfig, ["mjsense", "'CameraSensorConfig'", "did you mean 'CameraSensorCfg'"]),
    "name of the package with a letter less": (lambda u: mjs.Simulaton, ["mjsense", "'Simulaton'", "did you mean 'Simulation'"]),
    # a running simulation
    "text for worlds": (lambda u: u.sim.reset("all"), ["world_ids", "integers or a mask", "'all'"]),
    "mask of worlds": (lambda u: u.sim.reset(np.zeros(3, bool)), ["world_ids", "a mask of shape (3,)", "2 worlds"]),
    "world -1": (lambda u: u.sim.reset([-1]), ["world id -1", "[0, 2)"]),
    "no steps": (lambda u: u.sim.step(0), ["step(0)", "at least 1"]),
    "half a step": (lambda u: u.sim.step(1.5), ["Simulation.step()", "control_steps", "an int", "1.5"]),
    "controls": (lambda u: setattr(u.sim, "ctrl", np.zeros((2, 3))), ["ctrl", "shape (2, 3)", "(2, 0)"]),
    "positions": (lambda u: setattr(u.sim, "qpos", np.zeros((3, 7))), ["qpos", "shape (3, 7)", "(2, 7)"]),
    "text for positions": (lambda u: setattr(u.sim, "qpos", "home"), ["qpos", "numbers", "'home'"]),
    "masses": (lambda u: u.sim.randomize("body_mass", np.zeros((2, 9))), ["body_mass", "shape (2, 9)", "(2, 2)"]),
    "a mass is nan": (lambda u: u.sim.randomize("body_mass", np.full((2, 2), np.nan)), ["body_mass", "finite", "world 0, element [0] is nan"]),
    "name of an option": (lambda u: u.sim.randomize("opt.gravty", 1), ["'gravty'", "did you mean 'gravity'?"]),
    "shape of an option": (lambda u: setattr(u.sim.options, "gravity", (0, 1)), ["opt.gravity", "shape (2,)", "(2, 3)"]),
    "flag of a running simulation": (lambda u: setattr(u.sim.options, "disableflags", ("gravty",)), ["opt.disableflags", "'gravty'", "did you mean 'gravity'?"]),
    "timestep of a running simulation": (lambda u: setattr(u.sim.options, "timestep", -1), ["timestep is -1", "positive"]),
    "number of a keyframe": (lambda u: u.sim.reset(key=3), ["keyframe 3", "the model has"]),
    # attach and Renderer
    "data and model": (lambda u: mjs.attach(u.state, u.model), ["attach()", "model must be a mujoco.MjModel", "MjData"]),
    "no data": (lambda u: mjs.attach(u.model, None), ["attach()", "data[0] must be a mujoco.MjData", "None"]),
    "data of another model": (
        lambda u: mjs.attach(u.model, mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))),
        ["attach()", "data[0] belongs to another model", "0 numbers", "7"],
    ),
    "camera of a Renderer": (lambda u: mjs.Renderer(u.model).update_scene(u.state, "tpo"), ["camera", "tpo", "top"]),
    "number of a camera": (lambda u: mjs.Renderer(u.model).update_scene(u.state, 5), ["camera id 5", "[-1, 1)"]),
    "model for data": (lambda u: mjs.Renderer(u.model).update_scene(u.model), ["Renderer.update_scene()", "data must be a mujoco.MjData", "MjModel"]),
    "size of a Renderer": (lambda u: mjs.Renderer(u.model, 0, 8), ["Renderer", "height", "at least 1", "0"]),
    "option of a Renderer": (
        lambda u: setattr(mjs.Renderer(u.model), "sample_per_pixel", 8),
        ["Renderer has no attribute 'sample_per_pixel'", "did you mean 'samples_per_pixel'?"],
    ),
    "file for a model": (lambda u: mjs.Renderer("robot.xml"), ["Renderer()", "model must be a mujoco.MjModel", "'robot.xml'"]),
    # environments
    "no task": (lambda u: mjs.make(None), ["make()", "task must be", "the name of one", "None"]),
    "scene": (lambda u: mjs.make("pick", scene="kichen"), ["'kichen'", "did you mean 'kitchen'?"]),
    "text for cameras": (lambda u: mjs.make("pick", cameras="wrist_camera"), ["cameras must be a sequence of str", "'wrist_camera'"]),
    "camera of a robot": (lambda u: mjs.make("pick", cameras=["wrist_camra"]), ["robot 'franka'", "'wrist_camra'", "did you mean 'wrist_camera'?"]),
    "camera system": (lambda u: mjs.make("pick", camera_system="driod"), ["camera system", "'driod'", "did you mean 'droid'?"]),
    "observations": (lambda u: mjs.make("pick", cameras=[], observations=["qps"]), ["no sensor or stream 'qps'", "did you mean 'qpos'?"]),
    "render mode": (lambda u: mjs.make("pick", render_mode="human"), ["render_mode", "'rgb_array'", "'human'"]),
    "controller": (lambda u: mjs.make("pick", arm_controller="ee_delta"), ["arm_controller", "'ee_delta'", "ee_delta_pose"]),
    "action space": (lambda u: mjs.make("pick", action_space="normalized"), ["action_space is 'normalized'", "did you mean 'normalised'?"]),
    "split": (lambda u: mjs.make("pick", split="val"), ["split is 'val'", "train, test"]),
    "meshes": (lambda u: mjs.make("pick", meshes="reel"), ["meshes is 'reel'", "auto, shapes, real", "did you mean 'real'?"]),
    "instructions": (lambda u: mjs.make("pick", instructions="varid"), ["instructions is 'varid'", "did you mean 'varied'?"]),
    "autoreset": (lambda u: mjs.make_vec("pick", autoreset_mode="nextstep"), ["autoreset_mode", "'nextstep'", "did you mean 'next_step'?"]),
    "horizon": (lambda u: mjs.make("pick", horizon=0), ["horizon is 0", "at least 1"]),
    "period of actions": (lambda u: mjs.make("pick", policy_dt_ms=33), ["policy_dt_ms", "33", "multiple", "2"]),
    "seconds for milliseconds": (lambda u: mjs.make("pick", policy_dt_ms=0.05), ["policy_dt_ms", "an int", "0.05"]),
    "share of disturbed episodes": (lambda u: mjs.make("pick", perturb=2), ["perturb is 2", "between 0 and 1"]),
    "seed": (lambda u: mjs.make("pick", seed=-1), ["seed", "from 0 on", "-1"]),
    "option of the other backend": (lambda u: mjs.make_vec("pick", device="cuda"), ["make_vec()", "device", "backend='warp'"]),
    "a step before reset": (lambda u: u.env.step(np.zeros(1)), ["call reset() before step()"]),
    "shape of an action": (lambda u: u.env.worlds.reset() and u.env.step(np.zeros(3)), ["actions", "shape (1, 3)", "(1, 1)"]),
    "an action is nan": (lambda u: u.env.worlds.reset() and u.env.step(np.full(1, np.nan)), ["actions of worlds [0]", "not finite"]),
    "text for an action": (lambda u: u.env.step("left"), ["action", "numbers", "'left'"]),
    "text for a seed": (lambda u: u.env.reset(seed="0"), ["TaskEnv.reset()", "seed", "an int", "'0'"]),
    "option of a reset": (lambda u: u.env.reset(options={"mask": [True]}), ["options has 'mask'", "'reset_mask' or 'episodes'"]),
    "mask of a reset": (
        lambda u: u.env.worlds.reset() and u.env.worlds.reset(options={"reset_mask": [True, False]}),
        ["reset_mask", "shape (2,)", "(1,)"],
    ),
    "expert without a policy": (lambda u: u.env.expert_action(), ["expert_action()", "no policy", "policy='planner'"]),
    "name of gymnasium": (lambda u: gymnasium.make("mjsense/Pik-v0"), ["Pik", "mjsense", "Did you mean: `Pick`?"]),
    "option of gymnasium": (lambda u: gymnasium.make("mjsense/Pick-v0", camras=[]), ["make()", "'camras'", "did you mean 'cameras'"]),
    # making recordings
    "no folder": (lambda u: mjs.record("pick"), ["record()", "missing", "'out'"]),
    "format": (lambda u: mjs.record("pick", out=u.tmp / "q", format="lerobt"), ["unknown export format 'lerobt'", "did you mean 'lerobot'"]),
    "no episodes": (lambda u: mjs.record("pick", out=u.tmp / "q", episodes=0), ["episodes is 0", "at least 1"]),
    "no worlds": (lambda u: mjs.record("pick", out=u.tmp / "q", worlds=0), ["worlds is 0", "at least 1"]),
    "columns of a policy": (
        lambda u: mjs.record("pick", out=u.tmp / "q", policy=lambda o: 0, cameras=[]),
        ["policy", "shape (1,)", "(1, 8)", "arm 7, gripper 1"],
    ),
    "camera of a recording": (lambda u: mjs.record("pick", out=u.tmp / "q", cameras=["wrist"]), ["robot 'franka'", "'wrist'", "wrist_camera"]),
    "a folder below a file": (lambda u: mjs.record("pick", out="/dev/null/x", cameras=[]), ["'/dev/null/x/house_0'", "Not a directory"]),
    "rate": (lambda u: mjs.Recorder(u.sim, u.tmp / "r", [], fps=0), ["Recorder()", "fps is 0", "positive"]),
    "names for sensors": (lambda u: mjs.Recorder(u.sim, u.tmp / "r", ["feet"]), ["'feet'", "mjsense.Sensor"]),
    "finish without begin": (
        lambda u: mjs.Recorder(u.sim, u.tmp / "r", [u.sim.scene["feet"]]).finish_episode(0),
        ["finish", "no episode", "world 0"],
    ),
    # reading and converting recordings
    "a folder without a recording": (lambda u: mjs.Dataset(u.tmp), ["contains no recording", "house_*/trajectories_batch_*.h5"]),
    "a file that is none": (lambda u: mjs.Dataset(__file__), ["test_mistakes.py", "not an HDF5 file"]),
    "number of an observation": (lambda u: u.data[10**6], ["1000000", "out of range", "6 observations"]),
    "a name for a number": (lambda u: u.data["qpos"], ["Dataset.__getitem__()", "index must be an int", "'qpos'"]),
    "stream of a window": (lambda u: mjs.Dataset(u.data.root, delta_timestamps={"rewrds": [0]}), ["'rewrds'", "did you mean 'rewards'?"]),
    "a number for a window": (
        lambda u: mjs.Dataset(u.data.root, delta_timestamps={"rewards": 0.1}),
        ["delta_timestamps['rewards'] is 0.1", "a list of numbers"],
    ),
    "memory for a cache": (lambda u: mjs.Dataset(u.data.root, cache_mb=-1), ["cache_mb is -1", "at least 0"]),
    "text for streams": (lambda u: mjs.Dataset(u.data.root, streams="rewards"), ["Dataset()", "streams must be a sequence of str", "'rewards'"]),
    "number of an episode": (lambda u: mjs.Dataset(u.data.root, episodes=[7]), ["episodes: 7", "has 1 episode"]),
    "key of a map": (lambda u: mjs.exporting.export_lerobot(u.data.root, u.tmp / "e", map={"stat": "obs/agent/qpos"}), ["map", "unknown key 'stat'", "state, action"]),
    "stream of a map": (
        lambda u: mjs.exporting.export_lerobot(u.data.root, u.tmp / "e", map={"state": "obs/agent/qps", "action": "obs/agent/qpos"}),
        ["Feature 'state'", "'obs/agent/qps'", "did you mean 'obs/agent/qpos'"],
    ),
    "no output": (lambda u: mjs.exporting.export_lerobot(u.data.root), ["export_lerobot()", "missing", "'out'"]),
    "source of an export": (lambda u: mjs.exporting.export_lerobot(u.tmp / "nothing", u.tmp / "e"), ["nothing", "no such file or directory"]),
    "source of a replay": (lambda u: mjs.check_replay(u.tmp / "nothing"), ["nothing", "no such file or directory"]),
    "source of a rendering": (lambda u: mjs.render(u.tmp / "nothing", out=u.tmp / "e"), ["nothing", "no such file or directory"]),
    "camera of a rendering": (lambda u: mjs.render(u.data.root, out=u.tmp / "e", cameras=["tpo"]), ["no camera named 'tpo'"]),
    "a folder without a LeRobot data set": (lambda u: mjs.import_lerobot(u.tmp, out=u.tmp / "e"), ["not a LeRobot data set", "meta/info.json"]),
    "robot of its own": (lambda u: mjs.Robot("fanka"), ["no robot named 'fanka'", "did you mean 'franka'?"]),
    "folder of a robot": (lambda u: mjs.Robot(folder_with(u.tmp, "robot.toml")), ["is a folder", "pass the file", "robot.toml'"]),
    "folder of a robot by name": (lambda u: mjs.make("pick", robot=folder_with(u.tmp, "robot.toml")), ["is a folder", "robot.toml'"]),
    "folder of a scene": (lambda u: mjs.make("pick", scene=folder_with(u.tmp, "scene.toml")), ["is a folder", "scene.toml'"]),
    "file of a robot": (lambda u: mjs.Robot("x/robot.toml"), ["x/robot.toml", "no such file"]),
    "port": (lambda u: mjs.view("pick", port=65536), ["port is 65536", "[0, 65535]"]),
    "stream of a plot": (lambda u: mjs.plot("pick", ["tcp_pos"], seconds=0.1), ["no stream 'tcp_pos'", "did you mean 'tcp_pose'?"]),
    "a picture without a format": (lambda u: mjs.plot(u.data, ["rewards"], out=u.tmp / "p"), ["does not end in the name of a format", ".pdf", ".png"]),
    "a picture in no folder": (lambda u: mjs.plot(u.data, ["rewards"], out=u.tmp / "no/p.png"), ["cannot write", "no directory"]),
    "a recording without its folder": (lambda u: mjs.RecordEpisodes(u.env), ["RecordEpisodes() missing", "'out' and 'episodes'"]),
    "one sensor of a scene": (lambda u: mjs.SceneCfg(sensors=mjs.CameraSensorCfg(name="c")), ["must be a sequence of sensors, such as (sensor,), not CameraSensorCfg(name='c'", "..."]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_message(case, sim, data, tmp_path):
    model = mujoco.MjModel.from_xml_string(XML)
    mistake, parts = CASES[case]
    with pytest.raises((AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError, gymnasium.error.Error)) as error:
        mistake(SimpleNamespace(sim=sim, data=data, tmp=tmp_path, model=model, state=mujoco.MjData(model), env=mjs.make(Cart(), cameras=[])))
    message = str(error.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_there_are_enough():
    assert len(CASES) >= 139


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
    found, expected = (run_program(*given) for given in (words, [*words[1:], "--help"]))
    assert found.returncode == expected.returncode == 0
    assert found.stdout == expected.stdout != ""


def test_another_mujoco_warp_is_named(monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda name: "3.11.0")
    with pytest.raises(ImportError, match=r"backend='warp' needs mujoco-warp 4\.0, and 3\.11\.0 is installed.*pip install \"mjsense\[warp\]\""):
        mjs.Simulation(scene_of(), backend="warp")
