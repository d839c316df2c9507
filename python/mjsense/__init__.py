# SPDX-License-Identifier: Apache-2.0
"""mjsense: batched sensors for MuJoCo, from the simulator to the policy to the disk."""

from mjsense import _libmujoco

_libmujoco.load()  # first: the extension shares what `import mujoco` loads

from mjsense import _core

_libmujoco.check(_core)

from mjsense import configs, effects, observations
from mjsense._core import SensorSpec, __version__, embedded_models, policy_names, robot_names, task_names
from mjsense.configs import *  # noqa: F403
from mjsense.contact import ContactSensor
from mjsense.data import CameraData, ContactData, ImuData, RayCastData, SensorData
from mjsense.drawing import DebugShapes
from mjsense.effects import EffectSensorCfg
from mjsense.errors import UnknownNameError
from mjsense.imu import ImuSensor
from mjsense.pipeline import ObservationPipeline
from mjsense.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.record import RecordProgress, RecordSummary, record
from mjsense.scene import Entity, Scene
from mjsense.sensor import BuiltinSensor, NativeSensor, Sensor, SensorError
from mjsense.simulation import Simulation
from mjsense.suite import SensorSuite
from mjsense.vector import TaskVectorEnv, make_vec

# fmt: off
__all__ = [
    *configs.__all__,
    "BuiltinSensor", "CameraData", "CameraSensor", "ContactData", "ContactSensor", "DebugShapes", "EffectSensorCfg",
    "Entity", "ImuData", "ImuSensor", "LidarSensor", "NativeSensor", "ObservationPipeline", "RayCastData",
    "RayCastSensor", "RecordProgress", "RecordSummary", "Scene", "Sensor", "SensorData", "SensorError", "SensorSpec",
    "SensorSuite", "Simulation", "TaskVectorEnv", "TerrainHeightSensor", "UnknownNameError", "effects",
    "embedded_models", "make_vec", "observations", "policy_names", "record", "robot_names", "task_names",
    "__version__",
]
