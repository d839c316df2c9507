# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor``: sensor configurations, data classes, sensors, and base classes of user-defined sensors."""

from mjsense.compat.mjlab.sensor.builtin_sensor import BuiltinSensor, BuiltinSensorCfg, ObjRef
from mjsense.compat.mjlab.sensor.camera_sensor import CameraSensor, CameraSensorCfg, CameraSensorData
from mjsense.compat.mjlab.sensor.contact_sensor import ContactData, ContactMatch, ContactSensor, ContactSensorCfg
from mjsense.compat.mjlab.sensor.raycast_sensor import (
    GridPatternCfg,
    PatternCfg,
    PinholeCameraPatternCfg,
    RayCastData,
    RayCastSensor,
    RayCastSensorCfg,
    RingPatternCfg,
)
from mjsense.compat.mjlab.sensor.sensor import Sensor, SensorCfg
from mjsense.compat.mjlab.sensor.sensor_context import SensorContext
from mjsense.compat.mjlab.sensor.terrain_height_sensor import TerrainHeightData, TerrainHeightSensor, TerrainHeightSensorCfg

__all__ = [
    "BuiltinSensor",
    "BuiltinSensorCfg",
    "CameraSensor",
    "CameraSensorCfg",
    "CameraSensorData",
    "ContactData",
    "ContactMatch",
    "ContactSensor",
    "ContactSensorCfg",
    "GridPatternCfg",
    "ObjRef",
    "PatternCfg",
    "PinholeCameraPatternCfg",
    "RayCastData",
    "RayCastSensor",
    "RayCastSensorCfg",
    "RingPatternCfg",
    "Sensor",
    "SensorCfg",
    "SensorContext",
    "TerrainHeightData",
    "TerrainHeightSensor",
    "TerrainHeightSensorCfg",
]
