# SPDX-License-Identifier: Apache-2.0
"""Wrong arguments of every public method, and misspelt attributes, raise errors of one sentence."""

import inspect
import sys
import types

import mujoco
import numpy as np
import pytest
from scenes import BALL, ball_scene, feet_cfg

import mjsense as mjs
from mjsense.cluster import exporting as cluster_exporting
from mjsense.core.old_names import ROOMS

# Users write the methods of the first three; environments have those of Gymnasium, see below. A viewer is made by a function.
ENVS = (mjs.tasks.TaskVectorEnv, mjs.RecordEpisodes, mjs.recording.RecordVectorEpisodes)
MADE = (mjs.exporting.Format, mjs.exporting.Option, mjs.exporting.Source)  # what a user-defined export format reads
SKIPPED = (mjs.Sensor, mjs.Task, mjs.Policy, mjs.viewer.Viewer, *ENVS, *MADE)
PUBLIC = [*vars(mjs).values(), *(getattr(sys.modules[room], name) for room in ROOMS for name in sys.modules[room].__all__)]
CLASSES = [
    value
    for value in PUBLIC
    if isinstance(value, type)
    and not issubclass(value, (Exception, *SKIPPED))
    and not hasattr(value, "__dataclass_fields__")
    and value.__module__.startswith("mjsense.")
    and value is not mjs.sensors.SensorSpec
]
FUNCTIONS = [mjs.record, mjs.attach, mjs.make, mjs.make_vec, mjs.replay, mjs.check_replay, mjs.render, mjs.sensors.replace, *(f for f in vars(mjs.observations).values() if isinstance(f, types.FunctionType))]


def methods_of(cls):
    for name, value in inspect.getmembers(cls, inspect.isfunction):
        if name == "__init__" or name[0] != "_":
            yield value


def parameters_of(function):
    """Those that are declared to be something."""
    found = inspect.signature(function).parameters.values()
    return [p for p in found if p.annotation not in (p.empty, "Any", "np.ndarray", "Sequence[int] | None") and p.kind < 4 and p.kind != 2]


def ids(function):
    return function.__qualname__


NATIVE = {mjs.sensors.NativeSensor, mjs.sensors.BuiltinSensor, mjs.scene.Entity}  # created by scenes only
STATIC = {f.__qualname__: f for c in [*(c for c in CLASSES if c not in NATIVE), mjs.tasks.TaskVectorEnv] for f in methods_of(c) if ids(f) != "TaskVectorEnv.__init__" if f.__module__.startswith("mjsense")}
STATIC["RecordEpisodes.__init__"] = mjs.RecordEpisodes.__init__
STATIC |= {f.__qualname__: f for f in FUNCTIONS if f is not mjs.sensors.replace and f.__name__ != "checked"}


@pytest.mark.parametrize("function", [f for f in STATIC.values() if "NativeSensor.__init__" not in ids(f)], ids=ids)
def test_wrong_types_are_named(function):
    for parameter in parameters_of(function):
        if "Any" in parameter.annotation and "[" not in parameter.annotation:
            continue
        with pytest.raises(TypeError, match=rf"\(\): {parameter.name} must be "):
            function(*[None] * ("self" in inspect.signature(function).parameters), **{parameter.name: types.SimpleNamespace()})


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """An object of every class, and valid arguments."""
    scene = mjs.Scene(
        mjs.SceneCfg(
            entities={"ball": mjs.EntityCfg(model=BALL)},
            terrain=mjs.TerrainCfg(),
            sensors=(
                feet_cfg(track_air_time=True),
                mjs.RayCastSensorCfg(name="scan", frame=mjs.ObjRef("body", "ball", "ball")),
                mjs.LidarSensorCfg(name="lidar", frame=mjs.ObjRef("body", "ball", "ball"), scan=mjs.SpinningScanCfg(samples=4)),
                mjs.TerrainHeightSensorCfg(name="height", frame=mjs.ObjRef("body", "ball", "ball")),
                mjs.CameraSensorCfg(name="eye", width=4, height=4),
                mjs.ImuSensorCfg(name="imu", site=mjs.ObjRef("site", "imu", "ball")),
            ),
        )
    )
    sim = mjs.Simulation(scene, num_worlds=2)
    objects = [scene, sim, *(scene[k] for k in ("touch", "scan", "lidar", "height", "eye", "imu", "ball/acc")), scene["ball"]]
    objects += [mjs.SensorSuite([scene["scan"]]), mjs.sensors.ObservationPipeline(2), sim.debug_shapes(0, "scan")]
    objects += [mjs.Recorder(sim, tmp_path_factory.mktemp("data"), [scene["scan"]]), mjs.make("pick", cameras=[]), mjs.tasks.WorldState(sim, 0, 0)]
    objects[-2].reset()
    mjs.record("pick", out=(data := tmp_path_factory.mktemp("pick")), width=32, height=24, horizon=2, keep_failures=True, num_worlds=1)
    dataset = mjs.Dataset(data)
    renderer = mjs.Renderer(scene.model, 4, 4)
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    renderer.update_scene(data)
    objects += [mjs.attach(scene.model, mujoco.MjData(scene.model)), renderer, dataset, dataset.episodes[0], dataset.episodes[0].video("wrist_camera")]
    objects += [
        mjs.sensors.JointPositionSensor(), mjs.sensors.JointVelocitySensor(), mjs.sensors.PoseSensor("p", body="ball/ball"), mjs.sensors.TcpPoseSensor(),
        mjs.sensors.RobotBasePoseSensor(), mjs.sensors.EnvStatesSensor(), mjs.sensors.CameraParameterSensor("eye"), mjs.sensors.CameraImageSensor("eye"),
        mjs.sensors.ImagePointsSensor({}, []), mjs.sensors.GraspStateSensor("ball/ball"), mjs.Robot("franka"),
    ]  # fmt: skip
    return {type(o): o for o in objects}, sim


RIGHT = {"field": "geom_friction", "values": 1.0, "name": "geom_friction", "uuid": "scan", "kind": "line", "dt": 0.1, "sensors": [],
         "env": None, "center": (0, 0, 0), "start": (0, 0, 0), "end": (0, 0, 1), "radius": 0.1, "color": (1, 0, 0, 1), "num_envs": 2,
         "position": (0, 0, 0), "rotation_matrix": np.eye(3), "path": "x.nothing", "scene": None, "sensor": None, "world": 0,
         "episode": 0, "body": "ball/ball", "joint": "ball/root", "pos": (0, 0, 0), "value": 0.0, "actions": [[0.0] * 8],
         "group": "arm", "camera": "wrist_camera", "model": None, "data": None, "datas": [], "t": 0, "pose": [0.5, 0, 0.9, 0, 1, 0, 0]}  # fmt: skip
WRONG = ("3", 1.5, -1, 2**40, 10**30, np.nan, None, True, b"x", object(), [0.5], [-1], [7], ["a"], {}, np.zeros((1, 2, 3)))


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_argument_errors_do_not_mention_bindings(cls, live):
    objects, _sim = live
    if cls not in objects:
        core = cls.__module__ == "mjsense.sensors.core_sensors"  # NativeSensors, made of a simulation's robot
        assert core or cls in (mjs.sensors.NativeSensor, mjs.sensors.BuiltinSensor), "give the fixture an object of it"
        return
    for function in methods_of(cls):
        if function.__name__ in ("__init__", "close", "reset_sensors"):
            continue
        call = getattr(objects[cls], function.__name__)
        parameters = inspect.signature(call).parameters.values()
        for parameter in parameters:
            for wrong in WRONG:
                needed = {p.name: RIGHT[p.name] for p in parameters if p.default is p.empty and p.kind < 2 and p is not parameter}
                if parameter.kind in (2, 4):
                    continue
                try:
                    call(**{**needed, parameter.name: wrong})
                except Exception as error:
                    assert isinstance(error, (TypeError, ValueError, KeyError, RuntimeError, AttributeError)), (call, wrong)
                    text = str(error)
                    assert "incompatible function arguments" not in text and "SimpleNamespace" not in text, (call, parameter, wrong)


@pytest.mark.parametrize(
    "kwargs, text",
    [
        (dict(num_worlds=1.5), r"Simulation\(\): num_worlds must be an int of 32 bits or None, not 1.5"),
        (dict(num_worlds="4"), "num_worlds must be"),
        (dict(num_worlds=0), "num_worlds"),
        (dict(num_worlds=True), "num_worlds must be"),
        (dict(decimation=0), "decimation"),
        (dict(decimation=2.0), "decimation must be"),
        (dict(threads=-1), "threads"),
        (dict(seed=-1), "seed must be an int of 64 bits from 0 on, not -1"),
        (dict(seed=2**64), "seed must be"),
        (dict(seed="x"), "seed must be"),
    ],
)
def test_simulation_arguments(kwargs, text):
    with pytest.raises((TypeError, ValueError), match=text):
        mjs.Simulation(ball_scene(), **kwargs)


def test_method_errors_name_the_argument():
    sim = mjs.Simulation(ball_scene(), num_worlds=np.int64(2), decimation=np.int32(1))  # NumPy's ints are ints
    for call, text in [
        (lambda: sim.step("3"), r"Simulation.step\(\): control_steps must be an int of 32 bits, not '3'"),
        (lambda: sim.step(control_steps=1.5), "control_steps must be"),
        (lambda: sim.step(-1), "-1"),
        (lambda: sim.reset(seed=-1), "seed must be"),
        (lambda: sim.reset("all"), "world_ids must be integers or a mask, not 'all'"),
        (lambda: sim.reset([0.5]), "world_ids must be integers"),
        (lambda: sim.reset([2]), "2"),
        (lambda: sim.randomize(3, 1.0), "field must be a str, not 3"),
        (lambda: mjs.record(out="x", cameras="wrist_camera"), "cameras must be a sequence of str or None, not 'wrist_camera'"),
        (lambda: mjs.record(out="x", episodes=1.5), r"record\(\): episodes must be an int"),
        (lambda: mjs.make_vec(num_envs="2"), r"make_vec\(\): num_envs must be"),
    ]:
        with pytest.raises((TypeError, ValueError), match=text):
            call()


def test_misspelt_attributes():
    scene = ball_scene(feet_cfg())
    sim = mjs.Simulation(scene)
    for owner, name, near in [
        (sim, "qposs", "qpos"),
        (scene, "sensorss", "sensors"),
        (scene["ball"], "body_name", "body_names"),
        (scene["touch"], "dat", "data"),
        (scene["touch"].cfg, "num_slot", "num_slots"),
        (mjs.SceneCfg(), "num_env", "num_envs"),
        (mjs.MujocoCfg(), "time_step", "timestep"),
        (mjs.TerrainCfg(), "level", "levels"),
        (mjs.CameraSensorCfg(name="a"), "with", "width"),
        (mjs.SensorSuite(), "sensor", "sensors"),
        (mjs.sensors.ObservationPipeline(1), "num_world", "num_worlds"),
        (mjs.sensors.DebugShapes(), "mean_size", "meansize"),
    ]:
        with pytest.raises(AttributeError, match=f"has no attribute '{name}'; did you mean .*'{near}'"):
            setattr(owner, name, 3)
    with pytest.raises(AttributeError, match=r"mjData\.xpos is computed from the state"):
        sim.data.xpos = 3
    with pytest.raises(AttributeError):
        scene["touch"].data.force = 3
    sim.data.ctrl = 0  # a part of the state may be written
    sim.qpos = sim.qpos.copy()


def test_user_defined_classes_may_have_more_attributes():
    class Mine(mjs.Simulation):
        def __init__(self, scene):
            super().__init__(scene)
            self.extra = 3

    assert Mine(ball_scene()).extra == 3


def test_measurements_are_read_only():
    class Own(mjs.Sensor):
        uuid = "own"
        observation_space = __import__("gymnasium").spaces.Box(0, 10, (1,), np.float32)

        def compute(self, sim):
            return sim.qpos[:, 2:3].astype(np.float32)

    own = Own()
    scene = ball_scene(feet_cfg(), own)
    sim = mjs.Simulation(scene, num_worlds=2)
    for array in (scene["ball/acc"].data, scene["touch"].data.force, scene["touch"].fields["found"], own.data, own.rows, sim.data.xpos):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 3
    sim.step()
    assert own.data[0, 0] == np.float32(sim.qpos[0, 2])
    copy = scene["ball/acc"].data.copy()
    copy[:] = 3
    assert np.shares_memory(np.from_dlpack(scene["ball/acc"].data), scene["ball/acc"].data)


def test_values_of_the_wrong_kind_are_named(live):
    objects, sim = live
    dataset, env = objects[mjs.Dataset], objects[mjs.tasks.TaskEnv]
    suite = mjs.SensorSuite([sim.scene["scan"]])
    for call, error, text in [
        (lambda: dataset.stats([1]), TypeError, r"Dataset.stats\(\): streams must be a sequence of str or None, not \[1\]"),
        (lambda: sim.debug_shapes(0, 3), TypeError, "sensors must be a sensor, its name, or a sequence of these, not 3"),
        (lambda: sim.update_sensors(np.nan), ValueError, "dt must be at least 0 s and finite, not nan"),
        (lambda: sim.update_sensors(-0.1), ValueError, "dt must be at least 0 s and finite, not -0.1"),
        (lambda: suite.get_observations(3), TypeError, "env must be a Simulation, or an object with one as its sim, not 3"),
        (lambda: env.step({"arm": 1}), ValueError, r"action: values must be numbers, not .*'arm': 1"),
        (lambda: env.step([[1, 2], [3]]), ValueError, "action: values must be numbers, not "),
    ]:
        with pytest.raises(error, match=text):
            call()


CART = """<mujoco><worldbody><body name="cart"><joint name="slide" type="slide"/><geom size=".05"/></body></worldbody>
  <actuator><position name="drive" joint="slide" ctrlrange="-1 1"/></actuator></mujoco>"""


class Drive(mjs.Task):
    horizon, policy_dt_ms, sim_dt_ms, robot_entity = 5, 20, 4, "cart"

    def scene(self):
        return mjs.SceneCfg(entities={"cart": mjs.EntityCfg(model=CART)})

    def evaluate(self, sim):
        return np.zeros(2), np.zeros(2, bool)


@pytest.mark.parametrize(
    "attributes, text",
    [
        ({"robot_entity": None}, "robot_entity must be a str, not None"),
        ({"sensors": lambda self: None}, r"sensors\(\) must return a list of sensors, not None"),
        ({"evaluate": lambda self, sim: (["a", "b"], [True, False])}, "reward: values must be numbers"),
        ({"sample": lambda self, rng, world: world.set_joint("cart/slide", np.nan)}, "set_joint: value of 'cart/slide': must be finite, not nan"),
        ({"sample": lambda self, rng, world: world.place("cart/mocap_base", (0, 0))}, r"place: pos of '.*': shape \(2,\) does not broadcast to \(3,\)"),
    ],
)  # fmt: skip
def test_mistakes_of_a_task_are_named(attributes, text):
    task = type("Wrong", (Drive,), attributes)()
    with pytest.raises((TypeError, ValueError), match=text):
        env = mjs.make_vec(task, num_envs=2, cameras=[])
        env.reset(seed=0)
        env.step(env.action_space.sample())


@pytest.mark.parametrize("attribute", ["uuid", "unit", "frame"])
def test_texts_of_a_sensor_must_be_texts(attribute):
    class Own(mjs.Sensor):
        uuid = "own"
        observation_space = __import__("gymnasium").spaces.Box(0, 10, (1,), np.float32)

    own = type("Own", (Own,), {attribute: 3})()
    with pytest.raises(TypeError, match=f"Own.{attribute} must be a str, not 3"):
        mjs.Simulation(ball_scene()).add(own)


def test_the_number_of_worlds_has_one_name(tmp_path):
    data = tmp_path / "data"
    mjs.record("pick", out=data, cameras=[], horizon=2, keep_failures=True, num_worlds=1)
    for function, path in ((mjs.check_replay, data), (mjs.view, "pick")):
        with pytest.raises(TypeError, match=r"\(\) got an unexpected keyword argument 'num_envs'; did you mean 'num_worlds'\?$"):
            function(path, num_envs=2)
    with pytest.raises(TypeError, match=r"make_vec\(\) got an unexpected keyword argument 'num_worlds'; did you mean 'num_envs'\?$"):
        mjs.make_vec("pick", num_worlds=2)
    with pytest.warns(DeprecationWarning, match=r"^check_replay\(\): the argument worlds is now num_worlds$") as caught:
        assert mjs.check_replay(data, worlds=2)
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"^ObservationPipeline\(\): the argument num_envs is now num_worlds$") as caught:
        pipeline = mjs.sensors.ObservationPipeline(num_envs=2)
    assert caught[0].filename == __file__ and pipeline.num_worlds == 2
    with pytest.warns(DeprecationWarning, match="^ObservationPipeline.num_envs is now num_worlds$"):
        assert pipeline.num_envs == 2
    with pytest.raises(TypeError, match=r"'worlds'; did you mean 'num_worlds'\?$"):
        mjs.check_replay(data, worlds=2, num_worlds=2)


def test_the_source_comes_before_the_output(tmp_path, monkeypatch):
    sim = mjs.Simulation(ball_scene())
    with pytest.warns(DeprecationWarning, match=r"^Recorder\(out, simulation, ...\) is now Recorder\(simulation, out, ...\)$") as caught:
        old = mjs.Recorder(tmp_path / "old", sim, [])
    assert caught[0].filename == __file__ and old._simulation is sim and (tmp_path / "old").is_dir()
    with pytest.raises(TypeError, match=r"Recorder\(\): simulation must be a Simulation.*, not 'data'"), pytest.warns(DeprecationWarning):
        mjs.Recorder("data", "data")
    monkeypatch.setattr(cluster_exporting, "module_of", lambda format: (_ for _ in ()).throw(ValueError(format)))
    for given, named in [(("mcap", tmp_path, tmp_path / "out"), {}), (("mcap",), {"root": tmp_path, "out": tmp_path / "out"})]:
        with pytest.warns(DeprecationWarning, match=r"^export_on_ray\(format, root, out\) is now"), pytest.raises(ValueError, match=r"^mcap$"):
            cluster_exporting.export_on_ray(*given, **named)
