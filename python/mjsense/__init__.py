# SPDX-License-Identifier: Apache-2.0
"""mjsense: batched sensors for MuJoCo, from the simulator to the policy to the disk."""

from mjsense import _libmujoco

_libmujoco.load()  # first: the extension shares what `import mujoco` loads

from mjsense import _core

_libmujoco.check(_core)
_core.leave_no_log_file()

from mjsense import _gymnasium, assets, configs, effects, observations
from mjsense._core import SensorSpec, embedded_models, robot_names
from mjsense._core import __version__ as __version__  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
from mjsense._user_code import SensorError
from mjsense.configs import *  # noqa: F403
from mjsense.contact import ContactSensor
from mjsense.core_sensors import (
    CameraImageSensor,
    CameraParameterSensor,
    EnvStatesSensor,
    FunctionSensor,
    GraspStateSensor,
    ImagePointsSensor,
    JointPositionSensor,
    JointVelocitySensor,
    PoseSensor,
    RobotBasePoseSensor,
    TcpPoseSensor,
)
from mjsense.data import CameraData, ContactData, ImuData, RayCastData, SensorData
from mjsense.drawing import DebugShapes
from mjsense.effects import EffectSensorCfg
from mjsense.env import TaskEnv, make
from mjsense.errors import UnknownNameError
from mjsense.imu import ImuSensor
from mjsense.native_sensor import BuiltinSensor, NativeSensor
from mjsense.pipeline import ObservationPipeline
from mjsense.policy import Policy, policy_names, register_policy
from mjsense.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.record import RecordProgress, RecordSummary, record
from mjsense.recorder import Recorder
from mjsense.robot import MoveGroup, Robot, RobotCamera
from mjsense.scene import Entity, Scene
from mjsense.sensor import Sensor
from mjsense.simulation import Simulation
from mjsense.suite import SensorSuite
from mjsense.task import Task, WorldState, register_task, task_names
from mjsense.vector import TaskVectorEnv, make_vec

assets.name_package_folders()

_gymnasium.register_all()

# fmt: off
__all__ = [
    *configs.__all__,
    "BuiltinSensor", "CameraData", "CameraImageSensor", "CameraParameterSensor", "CameraSensor", "ContactData",
    "ContactSensor", "DebugShapes", "EffectSensorCfg", "Entity", "EnvStatesSensor", "FunctionSensor",
    "GraspStateSensor", "ImagePointsSensor", "ImuData", "ImuSensor", "JointPositionSensor", "JointVelocitySensor",
    "LidarSensor", "MoveGroup", "NativeSensor", "ObservationPipeline", "Policy", "PoseSensor", "RayCastData",
    "RayCastSensor", "RecordProgress", "RecordSummary", "Recorder", "Robot", "RobotBasePoseSensor", "RobotCamera",
    "Scene", "Sensor", "SensorData", "SensorError", "SensorSpec", "SensorSuite", "Simulation", "Task", "TaskEnv",
    "TaskVectorEnv", "TcpPoseSensor", "TerrainHeightSensor", "UnknownNameError", "WorldState", "effects",
    "embedded_models", "make", "make_vec", "observations", "policy_names", "record", "register_policy", "register_task",
    "robot_names", "task_names",
    "__version__",
]
