# SPDX-License-Identifier: Apache-2.0
"""Converts rows of text, and tells which sensors are images."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from mjsense.compat.molmospaces.env.sensors import CameraSensor, DepthSensor
from mjsense.sensors.core_sensors import CameraImageSensor
from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.sensor import encode_json
from mjsense.sensors.suite import SensorSuite


def is_camera_sensor(sensor_name: str, sensor_suite: SensorSuite | None) -> bool:
    """Whether the sensor of this name is a camera image; False for a name that is not in the suite."""
    if sensor_suite is None or sensor_name not in sensor_suite:
        return False
    sensor = sensor_suite.get(sensor_name)
    return isinstance(sensor, (CameraSensor, DepthSensor, CameraImageSensor)) or (
        isinstance(sensor, NativeSensor) and sensor.kind == "camera"
    )


def dict_to_byte_array(value: Any, str_max_len: int = 2000) -> np.ndarray:
    """JSON text as uint8 ``[str_max_len]``, padded with zeros; ValueError if it is longer."""
    text = encode_json(value)
    if len(text) > str_max_len:
        raise ValueError(f"JSON text of {len(text)} bytes, str_max_len is {str_max_len}")
    return np.frombuffer(text.ljust(str_max_len, b"\0"), np.uint8).copy()


def byte_array_to_string(row: np.ndarray) -> str:
    """The text of a row of dict_to_byte_array()."""
    return np.asarray(row, np.uint8).tobytes().rstrip(b"\0").decode()


def byte_array_to_dict(row: np.ndarray) -> Any:
    """The value of a row of dict_to_byte_array()."""
    return json.loads(byte_array_to_string(row))
