# SPDX-License-Identifier: Apache-2.0
"""A recording is resumed only if everything that decides its data is the same, and the error names what differs."""

import os
import pathlib
import re
import shutil
import struct
import types
import zlib

import gymnasium
import numpy as np
import pytest

import mjsense as mjs
from mjsense.tasks import code_checksums
from mjsense.tasks.code_checksums import checksums

MODELS = pathlib.Path(__file__).parents[2] / "models"
CUBE = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv 0 0 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 1 3 2\nf 1 4 3\n"
STATUE = """<mujoco>
  <asset>
    <mesh name="cone" file="cone.obj" scale="0.02 0.02 0.02"/>
    <texture name="paint" type="2d" file="paint.png"/>
    <material name="paint" texture="paint"/>
    <hfield name="ground" file="ground.png" size="0.1 0.1 0.1 0.1"/>
  </asset>
  <include file="more.xml"/>
  <worldbody>
    <geom name="cone" type="mesh" mesh="cone" material="paint" pos="-1 1 0.1"/>
    <geom name="ground" type="hfield" hfield="ground" pos="-1 -1 0"/>
  </worldbody>
</mujoco>"""
MORE = """<mujoco><worldbody><site name="mark" pos="1 1 1"/></worldbody></mujoco>"""


def png(value):
    """A grey picture of 2 x 2 pixels."""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(bytes([0, value, 9, 0, 99, value]))), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


SCALE = 2.0


def scaled(x):
    return SCALE * x


class Helper:
    def __init__(self):
        self.bias = 0.5


class Still(mjs.Policy):
    """Holds still."""

    gain = 1.0

    def __init__(self, weights=(1.0, 2.0)):
        self.weights = np.array(weights)
        self.options = {"depth": 3, "layers": [4, 5]}
        self.helper = Helper()

    def initialize(self):
        self.made_for_the_worlds = object()

    def act(self, obs):
        return {"arm": np.zeros((self.num_worlds, 7)) + 0 * scaled(self.gain)}


class OtherStill(Still):
    def act(self, obs):
        return {"arm": np.ones((self.num_worlds, 7))}


class Height(mjs.Sensor):
    uuid = "height"
    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (1,), np.float32)

    def __init__(self, offset=0.0):
        super().__init__()
        self.offset = offset

    def compute(self, sim):
        return np.full((sim.num_worlds, 1), self.offset, np.float32)


@pytest.fixture
def lab(tmp_path):
    """A robot and a scene of the user's, with a model, an included file, a mesh, a texture and a height field."""
    shutil.copytree(MODELS / "robots/franka", tmp_path / "arm")
    robot = tmp_path / "arm/robot.toml"
    robot.write_text(robot.read_text().split("# The real robot")[0])
    scene = tmp_path / "scene"
    scene.mkdir()
    (scene / "cone.obj").write_text(CUBE)
    (scene / "paint.png").write_bytes(png(50))
    (scene / "ground.png").write_bytes(png(60))
    (scene / "more.xml").write_text(MORE)
    (scene / "statue.xml").write_text(STATUE)
    (scene / "base.toml").write_text('name = "base"\nextends = "table"\ngap = 0.02\n')
    (scene / "scene.toml").write_text(
        'name = "mine"\nextends = "base.toml"\ngenerator = ""\n[[entities]]\nname = "room"\nmodel = "room.xml"\n'
        '[[entities]]\nname = "statue"\nmodel = "statue.xml"\n'
        '[[entities]]\nname = "mug"\nmodel = "mug.xml"\n[[entities]]\nname = "pear"\nmodel = "embedded:objects/pear.xml"\n'
        '[[objects]]\nbody = "mug/mug"\ntext = "mug"\n[[objects]]\nbody = "pear/pear"\ntext = "pear"\n'
    )
    shutil.copy(MODELS / "scenes/table/room.xml", scene)
    shutil.copy(MODELS / "objects/mug.xml", scene)
    (tmp_path / "cameras.json").write_text('{"eye": {"pos": [1, 0, 1.5], "forward": [-1, 0, -0.6], "up": [0, 0, 1], "fovy": 60}}')
    return tmp_path


CLOCK = iter(range(1, 10**6))


def write(path, data):
    path.write_bytes(data)
    os.utime(path, (next(CLOCK),) * 2)  # MuJoCo keeps the meshes that it has read, by name and second


def replaced(file, old, new):
    def change(lab):
        path = lab / file
        before = path.read_bytes()
        old_bytes, new_bytes = (x if isinstance(x, bytes) else x.encode() for x in (old, new))
        assert old_bytes in before, (file, old)
        write(path, before.replace(old_bytes, new_bytes, 1))
        return lambda: write(path, before)

    return change


def assigned(owner, name, value):
    def change(lab):
        before = getattr(owner, name)
        setattr(owner, name, value)
        return lambda: setattr(owner, name, before)

    return change


class Stop(Exception):
    pass


def interrupted(**options):
    """A recording that ends before all of its episodes are there."""

    def stop(progress):
        if progress.kept:
            raise Stop

    with pytest.raises(Stop):
        mjs.record(**options, progress=stop)


def options_of(lab):
    return dict(
        task="pick", robot=lab / "arm/robot.toml", scene=lab / "scene/scene.toml", policy=Still(), sensors=[Height()],
        camera_system=str(lab / "cameras.json"), width=32, height=24, horizon=3, keep_failures=True, episodes=40,
        seed=3, num_worlds=1, threads=1, out=lab / "data",
    )  # fmt: skip


def policy_with(**attributes):
    policy = Still()
    for name, value in attributes.items():
        setattr(policy, name, value)
    return policy


OPTIONS = {
    "task": (dict(task="pick_and_place", scene="tableware"), "task|streams|model|scene"),
    "robot": (dict(robot="franka"), "settings/robot"),
    "scene": (dict(scene="table"), "settings/scene|model"),
    "seed": (dict(seed=4), "settings/seed"),
    "a built-in policy": (dict(policy="planner"), "settings/(code|policy)|streams"),
    "camera_system": (dict(camera_system=""), "settings/camera"),
    "cameras": (dict(cameras=[]), "cameras|streams"),
    "width": (dict(width=48), "settings/cameras/0/width"),
    "height": (dict(height=48), "settings/cameras/0/height"),
    "depth": (dict(depth=True), "settings/cameras/0/depth"),
    "segmentation": (dict(segmentation=True), "settings/cameras/0/segmentation"),
    "samples": (dict(samples=4), "settings/samples"),
    "shadows": (dict(shadows=False), "settings/shadows"),
    "horizon": (dict(horizon=4), "settings/horizon"),
    "action_noise": (dict(action_noise=False), "settings/action_noise"),
    "perturb": (dict(perturb=0.5), "settings/perturb"),
    "terminate_upon_success": (dict(terminate_upon_success=True), "settings/terminate_upon_success"),
    "keep_failures": (dict(keep_failures=False), "settings/keep_failures"),
    "episodes": (dict(episodes=39), "'episodes' was 40 and is now 39"),
    "batches": (dict(batches=2), "'batches' was 10 and is now 2"),
    "gzip": (dict(gzip=5), "'gzip' was 4 and is now 5"),
    "crf": (dict(crf=20), "'video/crf' was 25 and is now 20"),
    "keyint": (dict(keyint=10), "'video/keyint' was 20 and is now 10"),
    "tune": (dict(tune=""), "video/tune"),
    "policy_dt_ms": (dict(policy_dt_ms=100), "fps|settings/policy_dt_ms"),
    "first_attempt": (dict(first_attempt=1), "'first_attempt' was absent and is now 1"),
    "num_attempts": (dict(num_attempts=40, episodes=1), "'num_attempts' was absent and is now 40"),
    "preset": (dict(preset="fast"), "video/preset"),
    "policy's class": (dict(policy=OtherStill()), "settings/(code/policy/code|policy)"),
    "policy's weights": (dict(policy=Still((1.0, 2.5))), "settings/code/policy/weights"),
    "policy's nested option": (dict(policy=policy_with(options={"depth": 3, "layers": [4, 6]})), "settings/code/policy/options"),
    "policy's further attribute": (dict(policy=policy_with(extra=1)), "settings/code/policy/extra"),
    "policy's function": (dict(policy=lambda obs: {"arm": np.zeros((1, 7))}), "settings/(code|policy)"),
    "sensor's attribute": (dict(sensors=[Height(0.5)]), "settings/code/sensor 'height'/offset"),
    "no sensor": (dict(sensors=[]), "settings/code/sensor 'height'|streams"),
}
FILES = {
    "robot.toml: noise": (replaced("arm/robot.toml", "[[parts]]", "[noise]\nscale = 0.2\n\n[[parts]]"), "settings/robot_file/noise"),
    "robot.toml: start": (replaced("arm/robot.toml", "-0.7853", "-0.7"), "settings/robot_file/groups"),
    "robot's arm": (replaced("arm/fr3.xml", 'damping="', 'damping="1'), "'model/(dof|actuator)' was"),
    "robot's gripper": (replaced("arm/2f85.xml", 'friction="', 'friction="1'), "'model/[a-z]+' was"),
    "robot's station": (replaced("arm/station.xml", 'size="', 'size="1'), "'model/[a-z]+' was"),
    "scene.toml": (replaced("scene/scene.toml", 'text = "mug"', 'text = "cup"'), "settings/scene_file/objects"),
    "scene that it extends": (replaced("scene/base.toml", "0.02", "0.03"), "settings/scene_file/gap"),
    "scene's room": (replaced("scene/room.xml", 'dir="-', 'dir="'), "'model/light' was"),
    "scene's object": (replaced("scene/mug.xml", 'mass="', 'mass="1'), "'model/(body|dof)' was"),
    "included file": (replaced("scene/more.xml", "1 1 1", "1 1 2"), "'model/site' was"),
    "mesh": (replaced("scene/cone.obj", "v 0 0 1", "v 0 0 2"), "'model/(bvh|body|geom|mesh)' was"),
    "texture": (replaced("scene/paint.png", png(50), png(51)), "'model/tex' was"),
    "height field": (replaced("scene/ground.png", png(60), png(61)), "'model/(geom|hfield)' was"),
    "cameras.json": (replaced("cameras.json", '"fovy": 60', '"fovy": 61'), "settings/camera_file|model/cam"),
    "class attribute": (assigned(Still, "gain", 2.0), "settings/code/policy/gain"),
    "method": (assigned(Still, "act", lambda self, obs: {"arm": np.zeros((1, 7))}), "settings/code/policy/code"),
    "global constant": (None, "settings/code/policy/code"),
    "helper's attribute": (dict(policy=policy_with(helper=type("Helper", (), {"bias": 1.0})())), "settings/code/policy/helper"),
}  # fmt: skip


def test_every_change_is_rejected_and_named(lab):
    options = options_of(lab)
    interrupted(**options)
    wrong = []

    def refused(name, expected, **change):
        try:
            mjs.record(**{**options, "policy": Still(), "sensors": [Height()], **change, "resume": True})
            wrong.append(f"{name}: accepted")
        except ValueError as error:
            if not re.search(expected, str(error)) or "different recording" not in str(error):
                wrong.append(f"{name}: {error}")

    def attempt(name, change, expected):
        if isinstance(change, dict):
            return refused(name, expected, **change)
        if name == "global constant":
            change = assigned(__import__(__name__), "SCALE", 3.0)
        undo = change(lab)
        refused(name, expected)
        undo()

    changes = {**OPTIONS, **FILES}
    assert len(changes) >= 40
    for name, (change, expected) in changes.items():
        attempt(name, change, expected)
    assert not wrong, "\n".join(wrong)
    # Without a change the recording resumes, also with a used policy, and with other numbers of worlds and threads.
    done = mjs.record(**{**options, "resume": True, "num_worlds": 2, "threads": 2})
    assert done.kept == 40 and done.enough and len(done.lengths) < 40


def test_settings_that_cannot_be_compared_are_named(tmp_path):
    import threading

    class Locked(Still):
        def __init__(self):
            super().__init__()
            self.lock = threading.Lock()

    class Named(Locked):
        def fingerprint(self):
            return "weights of Monday"

    options = dict(task="pick", cameras=[], horizon=3, keep_failures=True, episodes=40, num_worlds=1)
    interrupted(**options, policy=Locked(), out=tmp_path / "a")
    with pytest.raises(ValueError, match=r"attribute 'lock' of the policy has a _thread.lock.*method fingerprint\(\)"):
        mjs.record(**options, policy=Locked(), out=tmp_path / "a", resume=True)
    interrupted(**options, policy=Named(), out=tmp_path / "b")
    assert mjs.record(**options, policy=Named(), out=tmp_path / "b", resume=True).enough


def test_a_recorder_compares_the_model(tmp_path):
    simulations = []

    def recorder(size):
        model = f'<mujoco><worldbody><body><geom name="g" size="{size}"/></body></worldbody></mujoco>'
        sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(entities={"box": mjs.EntityCfg(model=model)})), num_worlds=1)
        simulations.append(sim)
        return mjs.Recorder(sim, tmp_path, [Height()], episodes=2, resume=True)

    def record(recorder, episode):
        recorder.begin_episode(0, episode)
        recorder.append()
        recorder.finish_episode(0)
        recorder.flush()

    first = recorder(0.1)
    record(first, 0)
    del first
    with pytest.raises(ValueError, match=r"'model/(body|geom)' was"):
        recorder(0.2)
    again = recorder(0.1)
    assert again.kept == 1
    record(again, 1)
    again.complete()


def test_a_sensor_of_a_robot_toml_is_compared_by_its_class(lab, monkeypatch):
    module = lab / "resumed_sensors.py"
    module.write_text(
        "import gymnasium\nimport numpy as np\nimport mjsense as mjs\n\n\nclass Grip(mjs.Sensor):\n"
        "    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)\n\n"
        "    def compute(self, sim):\n        return 1.0 * sim.qpos[:, :1].astype(np.float32)\n"
    )
    robot = lab / "arm/robot.toml"
    robot.write_text(robot.read_text() + '\n[[sensors]]\nkind = "python"\nname = "grip"\nclass = "resumed_sensors:Grip"\n')
    monkeypatch.syspath_prepend(lab)
    import resumed_sensors

    options = options_of(lab)
    interrupted(**options)
    compute = resumed_sensors.Grip.compute
    resumed_sensors.Grip.compute = lambda self, sim: 2.0 * sim.qpos[:, :1].astype(np.float32)
    with pytest.raises(ValueError, match="different recording: 'settings/code/sensor 'grip'/code' was"):
        mjs.record(**{**options, "policy": Still(), "sensors": [Height()], "resume": True})
    resumed_sensors.Grip.compute = compute
    assert mjs.record(**{**options, "policy": Still(), "sensors": [Height()], "resume": True}).enough


VALUES = (1, 1.0, "1", b"1", True, None, [1], [2], (1,), {1}, {1, 2}, {1, 3}, frozenset(), {"a": 1}, {"a": 2}, {"b": 1}, np.zeros(2),
          np.zeros(3), np.zeros(2, np.float32), lambda: 1, lambda: 2, property(lambda self: 1), property(lambda self: 2))  # fmt: skip


def test_attributes_that_differ_have_different_checksums():
    def checksum(value):
        return checksums(types.SimpleNamespace(value=value), "policy")["value"]

    found = [checksum(value) for value in VALUES]
    assert len(set(found)) == len(VALUES)
    assert checksum({1, 2, 3}) == checksum({3, 2, 1})


def test_classes_of_the_package_have_the_names_that_earlier_recordings_know(monkeypatch):
    written = []
    monkeypatch.setattr(code_checksums._Writer, "_text", lambda writer, text: written.append(text))
    checksums(Height(), "sensor 'height'")
    checksums(Still(), "policy")
    named = {text.removesuffix(f" {mjs.__version__}") for text in written if text.startswith("mjsense.")}
    assert named == {"mjsense.sensor.Sensor", "mjsense._show.HelpOfObject", "mjsense.policy.Policy"}
