# SPDX-License-Identifier: Apache-2.0
"""The sensors that MolmoSpaces' documentation names.

Sensors of the core suite are computed by mjsense in C++; the others are computed in Python, one world at a time.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from mjsense.compat.molmospaces.env.abstract_sensors import CoreSensor, Sensor
from mjsense.compat.peer.matrices import matrix_of, pose_of_matrix
from mjsense.core.mujoco_names import bodies_below
from mjsense.sensors.core_sensors import TcpPoseSensor

_POSE = gymnasium.spaces.Box(-np.inf, np.inf, (7,), np.float32)
_NUMBER = gymnasium.spaces.Box(-(2**31), 2**31 - 1, (), np.int64)


class RoleName(str):
    """Placeholder for the object of a role, whose body depends on the episode. Used while the suite is composed, for example as
    ``config.task_config.pickup_obj_name``.
    """


def body_name(object_name: str, task: Any) -> str:
    """The body of this name, or the body that has the role in the world whose sensor is computed."""
    return getattr(task.config.task_config, f"{object_name}_name") if isinstance(object_name, RoleName) else object_name


def _body_pose(env: Any, batch_index: int, name: str) -> np.ndarray:
    data = env.mj_datas[batch_index]
    body = data.body(name)
    return np.concatenate([body.xpos, body.xquat])


# --------------------------------------------------------------------------------------------------------- the core suite


class CameraParameterSensor(CoreSensor):
    """Extrinsic and intrinsic parameters of a camera."""

    def __init__(self, camera_name: str, uuid: str | None = None, **kwargs: Any) -> None:
        super().__init__(uuid or f"sensor_param_{camera_name}")


class CameraSensor(CoreSensor):
    """Colour of a camera, uint8 ``[H, W, 3]``."""

    def __init__(self, camera_name: str, uuid: str | None = None, **kwargs: Any) -> None:
        super().__init__(uuid or camera_name)


class DepthSensor(CoreSensor):
    """Depth of a camera, float32 ``[H, W]`` m."""

    def __init__(self, camera_name: str, uuid: str | None = None, **kwargs: Any) -> None:
        super().__init__(uuid or f"{camera_name}_depth")


class RobotJointPositionSensor(CoreSensor):
    """Joint positions by move group."""

    uuid = "qpos"


class RobotJointVelocitySensor(CoreSensor):
    """Joint velocities by move group."""

    uuid = "qvel"


class RobotBasePoseSensor(CoreSensor):
    """Pose of the base in the world."""

    uuid = "robot_base_pose"


class EnvStateSensor(CoreSensor):
    """The state of free bodies and articulations."""

    uuid = "env_states"


class TaskInfoSensor(CoreSensor):
    """The task's information about the state."""

    uuid = "task_info"


class LastActionSensor(CoreSensor):
    """The action as the policy returned it."""

    uuid = "actions/commanded_action"


class LastCommandedJointPosSensor(CoreSensor):
    """Targets of the controllers."""

    uuid = "actions/joint_pos"


class LastCommandedRelativeJointPosSensor(CoreSensor):
    """Targets minus the positions observed before."""

    uuid = "actions/joint_pos_rel"


class LastCommandedEETwistSensor(CoreSensor):
    """Twists from the tool frames observed before to those at the controllers' targets."""

    uuid = "actions/ee_twist"


class LastCommandedEEPoseSensor(CoreSensor):
    """Poses of the tool frames at the controllers' targets."""

    uuid = "actions/ee_pose"


class ObjectImagePointsSensor(CoreSensor):
    """Pixels that show the objects; omitted if the task has no camera."""

    uuid = "object_image_points"
    optional = True


class DoorStateSensor(CoreSensor):
    """State of a door and its handle, of tasks with a door."""

    uuid = "door_state"


def get_core_sensors(exp_config: Any) -> list[Any]:
    """The sensors of every task, in their published order: cameras, robot, state, actions, image points.

    Args:
        exp_config: the argument of ``_create_sensor_suite_from_config``.
    """
    sensors: list[Any] = []
    for camera in exp_config.camera_config.cameras:
        sensors += [CameraParameterSensor(camera.name), CameraSensor(camera.name)]
        if camera.record_depth:
            sensors.append(DepthSensor(camera.name))
    others = (
        RobotJointPositionSensor,
        RobotJointVelocitySensor,
        RobotBasePoseSensor,
        EnvStateSensor,
        TaskInfoSensor,
        LastActionSensor,
        LastCommandedJointPosSensor,
        LastCommandedRelativeJointPosSensor,
        LastCommandedEETwistSensor,
        LastCommandedEEPoseSensor,
        ObjectImagePointsSensor,
    )
    return [*sensors, *(sensor() for sensor in others)]


# ---------------------------------------------------------------------------------------------------- of tasks and objects


class ObjectStartPoseSensor(Sensor):
    """Pose of an object at the first observation of the episode, in the world: float32 ``[7]``, m and wxyz."""

    unit, frame = "m, wxyz", "world"

    def __init__(self, object_name: str, uuid: str = "obj_start", **kwargs: Any) -> None:
        super().__init__(uuid, _POSE)
        self.object_name = object_name
        self._start: np.ndarray | None = None

    def reset(self) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        self._start = None

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> np.ndarray:
        if self._start is None:
            if isinstance(self.object_name, RoleName):
                self._start = np.asarray(getattr(task.config.task_config, f"{self.object_name}_start_pose"))
            else:
                self._start = _body_pose(env, batch_index, self.object_name)
        return self._start.astype(np.float32)


class PickupObjGoalPoseSensor(Sensor):
    """Goal pose of the object, in the world: float32 ``[7]``, m and wxyz."""

    unit, frame = "m, wxyz", "world"

    def __init__(self, uuid: str = "obj_end", **kwargs: Any) -> None:
        super().__init__(uuid, _POSE)

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> np.ndarray:
        goal = task.config.task_config.pickup_obj_goal_pose
        if goal is None:
            raise ValueError(f"sensor '{self.uuid}': the task has no pose as a goal")
        return np.asarray(goal, np.float32)


class ObjectPoseSensor(Sensor):
    """Poses of objects in the frame of the robot's base, by name: m and wxyz."""

    is_dict = True

    def __init__(self, object_names: list[str], uuid: str = "object_poses", str_max_len: int = 2000, **kwargs: Any) -> None:
        super().__init__(uuid, gymnasium.spaces.Box(0, 255, (str_max_len,), np.uint8))
        self.object_names, self.str_max_len = list(object_names), str_max_len

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> dict[str, Any]:
        base = np.linalg.inv(env.robots[batch_index].robot_view.base.pose)
        poses = {}
        for name in self.object_names:
            body = env.mj_datas[batch_index].body(body_name(name, task))
            poses[str(name)] = pose_of_matrix(base @ matrix_of(body.xpos, body.xmat))
        return poses


class GraspStateSensor(Sensor):
    """Whether each gripper touches and holds an object: ``{gripper: {"touching", "held"}}``.

    An object is held if it touches nothing but grippers.
    """

    is_dict = True

    def __init__(self, object_name: str, uuid: str | None = None, str_max_len: int = 2000, **kwargs: Any) -> None:
        super().__init__(uuid or f"grasp_state_{object_name}", gymnasium.spaces.Box(0, 255, (str_max_len,), np.uint8))
        self.object_name, self.str_max_len = object_name, str_max_len
        self._geoms: tuple[np.ndarray, dict[str, np.ndarray]] | None = None

    def reset(self) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        self._geoms = None

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> dict[str, Any]:
        data = env.mj_datas[batch_index]
        view = env.robots[batch_index].robot_view
        if self._geoms is None:
            model = env.mj_model
            roots = {name: view.get_gripper(name).root_body_id for name in view.get_gripper_movegroup_ids()}
            of_grippers = {name: bodies_below(model, root)[model.geom_bodyid] for name, root in roots.items()}
            self._geoms = bodies_below(model, model.body(body_name(self.object_name, task)).id)[model.geom_bodyid], of_grippers
        of_object, of_grippers = self._geoms
        touching, foreign = dict.fromkeys(of_grippers, False), False
        for one, other in data.contact.geom:
            if of_object[one] == of_object[other] or one < 0 or other < 0:
                continue
            touched = other if of_object[one] else one
            gripper = next((name for name, geoms in of_grippers.items() if geoms[touched]), None)
            if gripper is None:
                foreign = True
            else:
                touching[gripper] = True
        return {name: {"touching": touches, "held": touches and not foreign} for name, touches in touching.items()}


# ------------------------------------------------------------------------------------------------------ of robots and policies


class TCPPoseSensor(TcpPoseSensor):
    """Pose of a gripper's tool in the frame of the robot's base: float32 ``[7]``, m and wxyz."""

    def __init__(self, uuid: str = "tcp_pose", gripper_group_id: str | None = None, **kwargs: Any) -> None:
        super().__init__(gripper_group_id, uuid)


class PolicyPhaseSensor(Sensor):
    """Number of the policy's current phase."""

    def __init__(self, uuid: str = "policy_phase", **kwargs: Any) -> None:
        super().__init__(uuid, _NUMBER)

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        policy = task._registered_policy
        return np.int64(policy.get_all_phases()[policy.get_phase()])


class PolicyNumRetriesSensor(Sensor):
    """Number of the policy's retries."""

    def __init__(self, uuid: str = "policy_num_retries", **kwargs: Any) -> None:
        super().__init__(uuid, _NUMBER)

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        return np.int64(task._registered_policy.retry_count)


class GraspPoseSensor(Sensor):
    """The policy's planned grasp pose, in the world: float32 ``[7]``, m and wxyz."""

    unit, frame = "m, wxyz", "world"

    def __init__(self, uuid: str = "grasp_pose", **kwargs: Any) -> None:
        super().__init__(uuid, _POSE)

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        return np.asarray(pose_of_matrix(task._registered_policy.target_poses["grasp"]), np.float32)


__all__ = [
    "CameraParameterSensor",
    "CameraSensor",
    "DepthSensor",
    "DoorStateSensor",
    "EnvStateSensor",
    "GraspPoseSensor",
    "GraspStateSensor",
    "LastActionSensor",
    "LastCommandedEEPoseSensor",
    "LastCommandedEETwistSensor",
    "LastCommandedJointPosSensor",
    "LastCommandedRelativeJointPosSensor",
    "ObjectImagePointsSensor",
    "ObjectPoseSensor",
    "ObjectStartPoseSensor",
    "PickupObjGoalPoseSensor",
    "PolicyNumRetriesSensor",
    "PolicyPhaseSensor",
    "RobotBasePoseSensor",
    "RobotJointPositionSensor",
    "RobotJointVelocitySensor",
    "TCPPoseSensor",
    "TaskInfoSensor",
    "get_core_sensors",
]
