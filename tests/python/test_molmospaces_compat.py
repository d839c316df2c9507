# SPDX-License-Identifier: Apache-2.0
"""Tasks and policies as MolmoSpaces' page on sensors writes them, with the imports changed."""

import abc
import json
import sys
import types

import h5py
import numpy as np
import pytest

import mjsense as mjs
from mjsense import _core
from mjsense.compat import molmospaces
from mjsense.compat.molmospaces.env.abstract_sensors import SensorSuite
from mjsense.compat.molmospaces.env.sensors import GraspStateSensor, ObjectStartPoseSensor, get_core_sensors
from mjsense.compat.molmospaces.policy.base_policy import InferencePolicy, PlannerPolicy, StatefulPolicy
from mjsense.compat.molmospaces.tasks.task import BaseMujocoTask
from mjsense.compat.molmospaces.utils.save_utils import byte_array_to_dict, dict_to_byte_array, is_camera_sensor
from mjsense.compat.peer.policy import PeerPolicy, register


class MyTask(BaseMujocoTask):
    def _create_sensor_suite_from_config(self, config):
        sensors = get_core_sensors(config)
        sensors.extend([
            ObjectStartPoseSensor(object_name=config.task_config.pickup_obj_name,
                                  uuid="obj_start_pose"),
            GraspStateSensor(object_name=config.task_config.pickup_obj_name,
                             uuid="grasp_state_pickup_obj"),
        ])
        return SensorSuite(sensors)  # fmt: skip


CORE = ["qpos", "qvel", "robot_base_pose", "env_states", "task_info", "actions/commanded_action", "actions/joint_pos",
        "actions/joint_pos_rel", "actions/ee_twist", "actions/ee_pose"]  # fmt: skip
OWN = ["obj_start_pose", "grasp_state_pickup_obj"]


def test_the_names_of_the_page():
    assert set(molmospaces.__all__) >= {
        "BaseMujocoTask", "BasePolicy", "CameraParameterSensor", "CameraSensor", "DepthSensor", "DoorStateSensor", "EnvStateSensor",
        "GraspPoseSensor", "GraspStateSensor", "LastActionSensor", "LastCommandedEEPoseSensor", "LastCommandedEETwistSensor",
        "LastCommandedJointPosSensor", "LastCommandedRelativeJointPosSensor", "ObjectImagePointsSensor", "ObjectPoseSensor",
        "ObjectStartPoseSensor", "PickupObjGoalPoseSensor", "PlannerPolicy", "PolicyNumRetriesSensor", "PolicyPhaseSensor", "Robot",
        "RobotBasePoseSensor", "RobotJointPositionSensor", "RobotJointVelocitySensor", "Sensor", "SensorSuite", "TCPPoseSensor",
        "TaskInfoSensor", "get_core_sensors", "is_camera_sensor"}  # fmt: skip
    assert all(hasattr(molmospaces, name) for name in molmospaces.__all__)


def test_the_task_of_the_page_on_its_own():
    task = MyTask(cameras=[], threads=2)
    task.register_policy("planner")
    with pytest.raises(ValueError, match="Policy already registered"):
        task.register_policy("planner")
    (observation,), _ = task.reset(seed=3)
    assert list(observation) == [*CORE, *OWN, "tcp_pose", "policy_phase", "policy_num_retries", "grasp_pose"]
    assert observation["grasp_state_pickup_obj"] == {"gripper": {"touching": False, "held": False}}
    held = False
    start = observation["obj_start_pose"]
    for _ in range(300):
        (observation,), _, terminated, truncated, _ = task.step(task.worlds.expert_action())
        np.testing.assert_array_equal(observation["obj_start_pose"], start)
        held |= observation["grasp_state_pickup_obj"]["gripper"]["held"]
        if terminated[0] or truncated[0] or task.worlds.expert_done[0]:
            break
    assert held and task.judge_success()
    with pytest.raises(ValueError, match="no move group named 'amr'; there are arm, gripper"):
        task.step({"amr": np.zeros(7)})
    with pytest.raises(ValueError, match="commands of gripper are missing"):
        task.step({"arm": np.zeros(7)})
    task.close()


def test_start_pose_and_grasp_are_those_of_the_core_suite(tmp_path):
    """The same episodes, with mjsense's own sensors and with those of the page."""
    options = dict(out=tmp_path, cameras=[], episodes=2, num_worlds=2, keep_failures=True, seed=3, horizon=120)
    ours, theirs = (mjs.record(task, **{**options, "out": tmp_path / name}) for task, name in (("pick", "ours"), (MyTask, "theirs")))
    for one, other in zip(sorted(ours.path.glob("*.h5")), sorted(theirs.path.glob("*.h5"))):
        with h5py.File(one) as a, h5py.File(other) as b:
            assert sorted(a) == sorted(b)
            for name in a:
                mine, yours = a[f"{name}/obs/extra"], b[f"{name}/obs/extra"]
                np.testing.assert_allclose(yours["obj_start_pose"], mine["obj_start"], atol=1e-6)
                np.testing.assert_array_equal(b[f"{name}/obs/agent/qpos"], a[f"{name}/obs/agent/qpos"])
                assert "obj_start" not in yours and "tcp_pose" in yours and "policy_phase" in yours
                for x, y in zip(yours["grasp_state_pickup_obj"], mine["grasp_state_pickup_obj"]):
                    assert byte_array_to_dict(x) == byte_array_to_dict(y)


def test_a_name_in_use_is_an_assertion_error_as_in_molmospaces():
    suite = SensorSuite([mjs.sensors.PoseSensor("a", body="x")])
    with pytest.raises(AssertionError, match="'a' is a duplicated sensor uuid"):
        suite.add(mjs.sensors.PoseSensor("a", body="y"))
    assert isinstance(suite, mjs.SensorSuite) and len(suite) == 1


def test_cameras_of_the_suite():
    task = MyTask(width=64, threads=2)
    suite = task.sensor_suite
    cameras = [name for name in suite.sensors if is_camera_sensor(name, suite)]
    assert cameras == ["wrist_camera", "exo_camera_1"] and not is_camera_sensor("qpos", suite) and not is_camera_sensor("x", suite)
    (observation,), _ = task.reset(seed=0)
    assert observation["wrist_camera"].shape == (36, 64, 3) and "object_image_points" in observation
    assert is_camera_sensor("rgb", SensorSuite([mjs.sensors.CameraImageSensor("wrist_camera", uuid="rgb")]))
    task.close()


def test_without_sensors():
    class Config:
        class task_config:
            use_sensors = False

    task = MyTask(Config, cameras=[])
    assert task.reset()[0] == [{}] and task.sensor_suite is None
    task.close()


class Reach(PlannerPolicy):
    """Opens and closes the gripper, and counts its calls."""

    def __init__(self):
        self.calls = 0

    def reset(self):
        self.calls = 0

    def get_all_phases(self):
        return {"open": 3, "close": 5}

    def get_phase(self):
        return "open" if self.calls < 3 else "close"

    def get_action(self, observation):
        self.calls += 1
        assert observation["qpos"]["arm"].shape == (7,)
        return {"arm": observation["qpos"]["arm"], "gripper": [0.0 if self.calls < 3 else 255.0], "done": self.calls == 6}


def test_policy_written_for_one_world_runs_in_many(tmp_path):
    task = MyTask()
    task.register_policy(Reach())
    summary = mjs.record(task, out=tmp_path, cameras=[], episodes=3, num_worlds=3, keep_failures=True)
    with h5py.File(next(summary.path.glob("*.h5"))) as file:
        trajectory = file["traj_0"]
        assert trajectory["obs/extra/policy_phase"][:].ravel().tolist() == [3, 3, 3, 5, 5, 5, 5]
        assert json.loads(trajectory["obs_scene"][()])["policy_phases"] == {"open": 3, "close": 5}
        assert len(trajectory["success"]) == 7


class Foreign:
    """The methods of an InferencePolicy of molmo_spaces 0.2.9, whose model answers with chunks of two actions."""

    def __init__(self, speed=0.02):
        self.speed, self.task = speed, None

    def reset(self):
        self.buffer, self.prompt = [], None

    def obs_to_model_input(self, obs):
        self.prompt = self.prompt or self.task.get_task_description()
        assert self.prompt == self.task.get_task_description() and self.task.config.task_type == "pick"
        return {"joints": obs["qpos"]["arm"], "step": self.task.episode_step_count}

    def inference_model(self, model_input):
        if not self.buffer:
            self.buffer = [model_input["joints"] + k * self.speed * model_input["step"] for k in (1, 2)]
        return self.buffer.pop(0)

    def model_output_to_action(self, model_output):
        return {"arm": model_output, "gripper": np.array([0.0])}

    def get_action(self, observation):
        return self.model_output_to_action(self.inference_model(self.obs_to_model_input(observation)))

    def create_policy_sensors(self):
        return []


class Stateful(Foreign):
    def get_state(self):
        return list(self.buffer), self.prompt

    def set_state(self, state):
        self.buffer, self.prompt = list(state[0]), state[1]


class Own(Stateful, InferencePolicy, StatefulPolicy):
    """The same with mjsense's classes."""

    def __init__(self):
        InferencePolicy.__init__(self, "configuration")
        self.speed = 0.02

    def get_action(self, observation):
        return InferencePolicy.get_action(self, observation) or {}


@pytest.mark.parametrize(("policy", "worlds"), ((f"python:{__name__}:Foreign", 2), (Stateful(), 3), (Own, 3)), ids=("copied", "shared", "own"))
def test_a_policy_with_a_model_plays_the_same_in_any_number_of_worlds(tmp_path, played, policy, worlds):
    results = mjs.evaluate("pick", policy=policy, out=tmp_path, num_worlds=worlds, **INFERRED)
    assert [one.number for one in results.dataset.episodes] == [0, 1, 2]
    for mine, other in zip(results.dataset.episodes, played, strict=True):
        np.testing.assert_array_equal(mine.states, other)


class Half(Foreign):
    """Commands the arm in some worlds, and the gripper in all."""

    def __init__(self, worlds):
        super().__init__()
        self.worlds = worlds

    def get_action(self, observation):
        action = super().get_action(observation)
        return action if self.task._world in self.worlds else {"gripper": action["gripper"]}


def test_worlds_without_a_command_hold_a_group_that_others_command(tmp_path):
    one, none = (
        [e.states for e in mjs.evaluate("pick", policy=Half(worlds), out=tmp_path / f"{len(worlds)}", num_worlds=2, **INFERRED | {"episodes": 2}).dataset.episodes]
        for worlds in ((0,), ()))  # fmt: skip
    assert not np.array_equal(one[0], none[0])
    np.testing.assert_array_equal(one[1], none[1])


INFERRED = {"episodes": 3, "horizon": 6, "cameras": [], "progress": False}


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """States of these episodes, computed in a loop of one world."""
    env = mjs.make_vec("pick", seed=0, horizon=6, cameras=[])
    states = []
    for number in range(3):
        observation, _ = env.reset(options={"episodes": [number]})
        rows, buffer = [env.sim.state[0].copy()], []
        for step in range(6):
            if not buffer:
                buffer = [observation["qpos"]["arm"][0] + k * 0.02 * step for k in (1, 2)]
            observation, *_ = env.step(np.concatenate([buffer.pop(0), [0.0]])[None])
            rows.append(env.sim.state[0].copy())
        states.append(rows)
    return states


def test_a_policy_is_an_instance_of_the_classes_that_have_been_imported(monkeypatch):
    class PlannerPolicy(abc.ABC):  # noqa: B024
        pass

    assert not issubclass(PeerPolicy, PlannerPolicy)
    monkeypatch.setitem(sys.modules, "molmo_spaces.policy.base_policy", types.SimpleNamespace(PlannerPolicy=PlannerPolicy))
    for _ in range(2):
        register()
        assert issubclass(PeerPolicy, PlannerPolicy)


def test_rows_of_text():
    row = dict_to_byte_array({"b": np.float32(1), "a": [1, 2]}, 30)
    assert row.shape == (30,) and byte_array_to_dict(row) == {"a": [1, 2], "b": 1.0}
    with pytest.raises(ValueError, match="JSON text of 9 bytes, str_max_len is 4"):
        dict_to_byte_array({"a": 123}, 4)


def test_invalid_suite_is_rejected():
    class Wrong(BaseMujocoTask):
        def _create_sensor_suite_from_config(self, config):
            return get_core_sensors(config)

    with pytest.raises(TypeError, match=r"Wrong\._create_sensor_suite_from_config\(\) must return a SensorSuite"):
        mjs.make_vec(Wrong, cameras=[])
    with pytest.raises(NotImplementedError, match="BaseMujocoTask: write _create_sensor_suite_from_config"):
        mjs.make_vec(BaseMujocoTask, cameras=[])


def test_segmentation_names_the_body_of_geoms_and_sites():
    """Types: 5 is mjOBJ_GEOM, 6 is mjOBJ_SITE, 9 is mjOBJ_LIGHT."""
    found = np.array([[(-1, -1), (0, 5), (2, 5)], [(1, 6), (1, 9), (3, 5)]], np.int32)
    image = np.empty((2, 3, 3), np.int32)
    _core.add_bodies(found, np.array([0, 7, 4], np.int32), np.array([8, 2], np.int32), image)
    assert image.tolist() == [[[-1, -1, -1], [0, 5, 0], [2, 5, 4]], [[1, 6, 2], [1, 9, -1], [3, 5, -1]]]
    with pytest.raises(ValueError, match="must have the image's size"):
        _core.add_bodies(found[:1], np.zeros(3, np.int32), np.zeros(2, np.int32), image)
