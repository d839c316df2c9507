# SPDX-License-Identifier: Apache-2.0
"""Sensors, their configurations and data, effects, and suites."""

from mjsense._core import SensorSpec
from mjsense.sensors import configs, effects, observations
from mjsense.sensors.configs import *  # noqa: F403
from mjsense.sensors.contact import ContactSensor
from mjsense.sensors.core_sensors import (
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
from mjsense.sensors.data import CameraData, ContactData, ImuData, RayCastData, SensorData
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.imu import ImuSensor
from mjsense.sensors.native_sensor import BuiltinSensor, NativeSensor
from mjsense.sensors.pipeline import ObservationPipeline
from mjsense.sensors.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.suite import SensorSuite
from mjsense.sensors.user_code import SensorError

__all__ = [
    *configs.__all__,
    "BuiltinSensor",
    "CameraData",
    "CameraImageSensor",
    "CameraParameterSensor",
    "CameraSensor",
    "ContactData",
    "ContactSensor",
    "DebugShapes",
    "EnvStatesSensor",
    "FunctionSensor",
    "GraspStateSensor",
    "ImagePointsSensor",
    "ImuData",
    "ImuSensor",
    "JointPositionSensor",
    "JointVelocitySensor",
    "LidarSensor",
    "NativeSensor",
    "ObservationPipeline",
    "PoseSensor",
    "RayCastData",
    "RayCastSensor",
    "RobotBasePoseSensor",
    "Sensor",
    "SensorData",
    "SensorError",
    "SensorSpec",
    "SensorSuite",
    "TcpPoseSensor",
    "TerrainHeightSensor",
    "effects",
    "observations",
]
