# SPDX-License-Identifier: Apache-2.0
"""Sensors that a robot brings: [[sensors]] of its file, and those of mjs.Robot."""

import shutil
import sys
from pathlib import Path

import gymnasium
import h5py
import numpy as np
import pytest
from program_runs import run_program

import mjsense as mjs

FRANKA = Path(__file__).parents[2] / "models" / "robots" / "franka"
TABLES = """
[[sensors]]
kind = "contact"
name = "finger_contact"
primary = { mode = "subtree", pattern = ["gripper/base"] }
fields = ["found", "force"]

[[sensors]]
kind = "builtin"
name = "tool_speed"
sensor_type = "framelinvel"
obj = { type = "site", name = "gripper/grasp_site" }
"""
PYTHON = """
[[sensors]]
kind = "python"
name = "grip"
class = "lab_sensors:Grip"
args = { gain = 2.5 }
"""
LAB = '''
import gymnasium
import numpy as np

import mjsense as mjs


class Grip(mjs.Sensor):
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64)

    def __init__(self, gain=1.0):
        super().__init__()
        self.gain = gain

    def compute(self, sim):
        return self.gain * sim.qpos[:, :1]
'''
TASK = dict(num_envs=2, cameras=[], seed=1, threads=2)


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """Writes a robot.toml with these tables."""

    def write(tables):
        folder = tmp_path / "lab_franka"
        shutil.copytree(FRANKA, folder, dirs_exist_ok=True)
        file = folder / "robot.toml"
        file.write_text((FRANKA / "robot.toml").read_text() + tables)
        return file

    (tmp_path / "lab_sensors.py").write_text(LAB)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "lab_sensors", raising=False)
    return write


def test_sensors_of_a_file(robot):
    env = mjs.make_vec("pick", robot=robot(TABLES + PYTHON), **TASK)
    observation, _ = env.reset()
    names = list(observation)
    assert names[-4:] == ["tcp_pose", "finger_contact", "tool_speed", "grip"]
    assert observation["finger_contact"]["force"].shape == (2, 1, 3)
    assert env.scene["robot_0/tool_speed"].kind == "builtin"
    for _ in range(3):
        observation, *_ = env.step(env.action_space.low * 0 + 0.1)
    np.testing.assert_array_equal(observation["grip"], 2.5 * env.sim.qpos[:, :1])
    np.testing.assert_array_equal(observation["tool_speed"], env.scene["robot_0/tool_speed"].data)
    assert np.abs(observation["tool_speed"]).max() > 0.01
    env.close()


def test_robot_sensors_precede_policy_sensors_and_are_recorded(robot, tmp_path):
    summary = mjs.record("pick", robot=robot(TABLES + PYTHON), out=tmp_path / "out", cameras=[], horizon=4, keep_failures=True)
    with h5py.File(next(summary.path.glob("*.h5"))) as file:
        extra = file["traj_0/obs/extra"]
        assert extra["finger_contact/found"].shape == (5, 1) and extra["grip"].shape == (5, 1) and extra["tool_speed"].shape == (5, 3)


class Count(mjs.Sensor):
    observation_space = gymnasium.spaces.Box(0, 100, (1,), np.float64)

    def get_observation(self, env, task, batch_index=0):
        return np.array([env.current_robot.robot_view.n_grippers], np.float64)


def test_sensors_of_an_object():
    franka = mjs.Robot("franka", sensors=[Count("grippers"), mjs.sensors.TcpPoseSensor(uuid="tool")])
    env = mjs.make_vec("pick", franka, policy="planner", **TASK)
    observation, _ = env.reset()
    assert list(observation)[-6:] == ["tcp_pose", "grippers", "tool", "policy_phase", "policy_num_retries", "grasp_pose"]
    np.testing.assert_array_equal(observation["tool"], observation["tcp_pose"])
    assert observation["grippers"].tolist() == [[1], [1]]
    env.close()

    class Lab(mjs.Robot):
        def create_robot_sensors(self):
            return [Count("grippers")]

    env = mjs.make("pick", Lab("franka"), cameras=[], use_sensors=True)
    assert "grippers" in env.reset()[0]
    env.close()
    with pytest.raises(ValueError, match="'qpos' is a duplicated sensor uuid: from task 'pick' and from robot 'franka'"):
        mjs.make_vec("pick", mjs.Robot("franka", sensors=[Count("qpos")]), **TASK)
    with pytest.raises(TypeError, match=r"make_vec\(\): robot must be the name of a robot, the path of its .toml, or a mjsense.Robot"):
        mjs.make_vec("pick", 3)


def test_program_names_a_class_that_is_not_found(robot, tmp_path):
    file = robot(PYTHON)
    words = ["record", "pick", "--robot", file, "--cameras", "none", "--out", tmp_path / "out"]
    done = run_program(*words, alone=True)  # without the sys.path of this process
    assert done.returncode != 0
    assert "robot.toml: sensor 'grip': class 'lab_sensors:Grip' is not found: No module named 'lab_sensors'" in done.stderr


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ('kind = "contakt"\nname = "x"', r"robot\.toml:\d+: no kind of 'sensors\[0\]' named 'contakt'; did you mean 'contact'"),
        ('kind = "camera"\nname = "x"', r"no kind of 'sensors\[0\]' named 'camera'"),
        ('name = "x"', r"robot\.toml:\d+: 'sensors\[0\]': 'kind' must be a non-empty string"),
        ('kind = "contact"\nname = "x"', r"robot\.toml:\d+: 'sensors\[0\]': 'primary' is missing"),
        ('kind = "imu"\nname = "x"\npresett = "y"', r"robot\.toml:\d+: no key of 'sensors\[0\]' named 'presett'; did you mean 'preset'"),
        ('kind = "python"\nname = "x"\nclass = "Grip"', r"class is 'Grip': must be 'package\.module:Class'"),
        ('kind = "python"\nname = "x"', r"'sensors\[0\]': 'class' must be a non-empty string"),
        ('kind = "python"\nname = "x"\nclass = "a:B"\ngain = 2', r"no key of 'sensors\[0\]' named 'gain'; available: name, class, args"),
        ('kind = "python"\nname = "x"\nclass = "lab_sensors:Gripp"', r"class 'lab_sensors:Gripp' is not found"),
        ('kind = "python"\nname = "x"\nclass = "lab_sensors:Grip"\nargs = { force = 2 }', r"class 'lab_sensors:Grip' cannot be made"),
    ],
)
def test_errors_name_the_table(robot, table, error):
    with pytest.raises((ValueError, TypeError, KeyError), match=error):
        mjs.make_vec("pick", robot=robot("\n[[sensors]]\n" + table + "\n"), **TASK)
