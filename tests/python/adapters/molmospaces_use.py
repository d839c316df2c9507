# SPDX-License-Identifier: Apache-2.0
"""An environment, sensors and the save path of molmo-spaces after mjsense.compat.molmospaces.use(), in a process without OpenGL.

python molmospaces_use.py PAGE

PAGE is docs/drop_in/molmospaces.md, whose example runs.
"""

import os

os.environ["MUJOCO_GL"] = "disable"

import importlib.metadata
import re
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import mujoco
import numpy as np
from molmo_spaces.env.abstract_sensors import Sensor, SensorSuite
from molmo_spaces.env.camera_manager import Camera
from molmo_spaces.env.env import CPUMujocoEnv
from molmo_spaces.env.sensors_cameras import CameraParameterSensor, CameraSensor, DepthSensor
from molmo_spaces.renderer.opengl_rendering import MjOpenGLRenderer
from molmo_spaces.utils.save_utils import prepare_episode_for_saving, save_trajectories

import mjsense
from mjsense.compat import molmospaces
from mjsense.compat.molmospaces import program

(block,) = re.findall(r"^```python\n(.*?)^```$", Path(sys.argv[1]).read_text(), re.MULTILINE | re.DOTALL)
page = {}
exec(block, page)
assert page["image"].std() > 5
model, data, renderer = page["model"], page["data"], page["renderer"]
assert {tuple(found) for found in page["segmentation"].reshape(-1, 3)} <= {(-1, -1, -1), (0, 5, 0), (1, 5, 1)}
assert (page["segmentation"] == (1, 5, 1)).all(-1).any()


def expect(error, message, function, *args, **kwargs):
    try:
        function(*args, **kwargs)
    except error as found:
        assert re.search(message, str(found)), found
    else:
        raise AssertionError(f"no error with {message!r}")


sites = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><camera pos="0 0 3"/><geom type="box" size=".3 .3 .1"/>
    <body pos=".6 0 0"><geom size=".2"/><site name="mark" pos="0 .5 0" size=".2"/></body></worldbody></mujoco>""")
with_sites = mujoco.MjData(sites)
mujoco.mj_forward(sites, with_sites)
shown = MjOpenGLRenderer(model=sites, width=64, height=48)
shown.update(with_sites, 0, mujoco.MjvOption())
shown.enable_segmentation_rendering()
found = {tuple(each) for each in shown.render().reshape(-1, 3).tolist()}
assert found == {(-1, -1, -1), (0, 5, 0), (1, 5, 1), (0, 6, 1)}, found

# Errors.
other = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><geom size='1'/></body></worldbody></mujoco>")
other_data = mujoco.MjData(other)
expect(ValueError, 'camera "frnt" does not exist. Nearest: front', renderer.update, data, camera="frnt")
expect(ValueError, "`data` belongs to another model", renderer.update, other_data)
expect(ValueError, "Expected `out.shape", renderer.render, out=np.empty((3, 3)))
expect(ValueError, "width must be at least 1", MjOpenGLRenderer, model=model, width=0, height=4)
expect(ValueError, "unknown shading 'pbrr'", molmospaces.use, shading="pbrr")
expect(ValueError, "threads must be at least 0", molmospaces.use, threads=-1)
version, importlib.metadata.version = importlib.metadata.version, lambda name: "0.3.0"
expect(ImportError, "tested with molmo-spaces 0.2.9, and 0.3.0 is installed", molmospaces.use)
importlib.metadata.version = version
renderer.close()
expect(RuntimeError, r"after close\(\)", renderer.render)

# An environment with two cameras.
config = SimpleNamespace(
    task_sampler_config=SimpleNamespace(task_batch_size=1, sim_settle_timesteps=2),
    camera_config=SimpleNamespace(img_resolution=(64, 48)),
)
env = CPUMujocoEnv(config, lambda data: None, model, "scene.xml")
for name, x in (("left_camera", -1.5), ("right_camera", 1.5)):
    forward = np.array([-x, 2.0, -0.8]) / np.linalg.norm([x, 2.0, 0.8])
    env.camera_manager.registry.add_camera(Camera(name, np.array([x, -2.0, 1.0]), forward, np.array([0.0, 0.0, 1.0]), 50 + 5 * x))
NAMES = {"left_camera": CameraSensor, "left_camera_depth": DepthSensor, "right_camera": CameraSensor, "right_camera_depth": DepthSensor}


SPACE = gymnasium.spaces.Box(0, 1, ())


class Push(Sensor):
    """Moves the ball, after the sensors before it have been read."""

    def get_observation(self, env, task, *args, **kwargs):
        env.mj_model.body_pos[1, 2] = 0.6
        mujoco.mj_kinematics(env.mj_model, env.current_data)
        return 0


def suite(*others):
    cameras = [of(name.removesuffix("_depth"), (64, 48), name) for name, of in NAMES.items()]
    return SensorSuite([*cameras[:2], *others, *cameras[2:]])


def observe(threads, sensors=None):
    molmospaces.use(threads=threads)
    return (sensors or suite()).get_observations(env=env, task=None, batch_index=0)


def one_by_one():
    return {name: sensor.get_observation(env, None) for name, sensor in suite().sensors.items()}


observe(1)  # from now on the scene's camera before an observation is the last one of the suite
expected = one_by_one()
drawn = []
take = program.Frames.take
program.Frames.take = lambda *arguments: drawn.append(take(*arguments)) or drawn[-1]
for threads in (1, 2, 0):
    drawn.clear()
    found = observe(threads)
    assert len(drawn) == 4 and all(image is not None for image in drawn), "the images were not drawn together"
    for name, image in expected.items():
        np.testing.assert_array_equal(found[name], image, err_msg=f"{name}, {threads} threads")
assert found["left_camera"].dtype == np.uint8 and found["left_camera"].shape == (48, 64, 3)
assert found["left_camera_depth"].dtype == np.float32 and found["left_camera_depth"].shape == (48, 64)
assert not np.array_equal(found["left_camera"], found["right_camera"])
moved = observe(2, suite(Push("push", SPACE)))
np.testing.assert_array_equal(moved["left_camera"], expected["left_camera"])
assert not np.array_equal(moved["right_camera"], expected["right_camera"]), "an image of the state before"
np.testing.assert_array_equal(moved["right_camera"], env.render_rgb_frame("right_camera"))
assert env.check_visibility("left_camera", "ball") > 0.02
in_thread = []
thread = threading.Thread(target=lambda: in_thread.append(env.render_rgb_frame("left_camera")))
thread.start()
thread.join()
np.testing.assert_array_equal(in_thread[0], env.render_rgb_frame("left_camera"))

# Changed textures and a model that was changed.
env._renderer.mark_textures_dirty()
observe(2)
assert not env._renderer._textures_need_upload

# The files of its save path.
sensors = suite(type("Qpos", (Sensor,), {"get_observation": lambda *a, **k: np.arange(3.0)})("qpos", SPACE))
for name in ("qvel", "actions/joint_pos"):
    sensors.sensors[name] = type("Zero", (Sensor,), {"get_observation": lambda *a, **k: np.zeros(3)})(name, SPACE)
sensors.add(CameraParameterSensor("left_camera", (64, 48), "sensor_param_left_camera"))
history = {
    "observations": [[sensors.get_observations(env=env, task=None)] for _ in range(5)],
    "rewards": [[0.5]] * 5,
    "truncateds": [[False]] * 5,
    "successes": [[False]] * 4 + [[True]],
    "obs_scene": {"text": "push the ball", "policy_dt_ms": 100.0},
}
with tempfile.TemporaryDirectory() as folder:
    house = Path(folder, "house_0")
    episode = prepare_episode_for_saving(history, sensors, 10.0, str(house), 0, "_batch_1_of_1")
    save_trajectories([episode], str(house), 10.0, "_batch_1_of_1")
    assert subprocess.run([sys.executable, "-m", "mjsense", "repair", folder], check=False).returncode == 0
    episode = mjsense.Dataset(folder).episodes[0]
    assert episode.success and episode.fps == 10
    np.testing.assert_array_equal(episode["obs/agent/qpos"], np.tile(np.arange(3.0), (5, 1)))
    np.testing.assert_array_equal(episode["rewards"], np.full(5, 0.5, np.float32))

env.close()
with open("/proc/self/maps") as maps:
    assert "libEGL" not in maps.read()
