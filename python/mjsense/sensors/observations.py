# SPDX-License-Identifier: Apache-2.0
"""Observation functions of sensors with mjlab's names: ``height_scan(sim, sensor_name="scan")``.

`env` is any object with a ``scene``: a :class:`mjsense.Simulation`, or an environment. The functions return new arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.core.arguments import checked


@checked
def builtin_sensor(env: Any, sensor_name: str) -> np.ndarray:
    """Value of the sensor, ``[B, dim]``."""
    return np.array(env.scene[sensor_name].data)


@checked
def projected_gravity_from_sensor(env: Any, sensor_name: str) -> np.ndarray:
    """Unit direction of gravity in a body's frame ``[B, 3]``: the negated value of a sensor of the world's up vector in that
    frame."""
    return -env.scene[sensor_name].data


@checked
def height_scan(env: Any, sensor_name: str, offset: float = 0.0, miss_value: float | None = None) -> np.ndarray:
    """Height of each ray's frame above the hit minus `offset`, ``[B, R]`` m; misses are `miss_value` (by default
    max_distance)."""
    sensor = env.scene[sensor_name]
    data = sensor.data
    if miss_value is None:
        miss_value = sensor.cfg.max_distance
    frames = data.frame_pos_w.shape[1]
    hit_z = data.hit_pos_w[:, :, 2].reshape(len(data.hit_pos_w), frames, -1)
    heights = (data.frame_pos_w[:, :, None, 2] - hit_z - np.float32(offset)).reshape(data.distances.shape)
    return np.where(data.distances < 0, np.float32(miss_value), heights)


@checked
def foot_height(env: Any, sensor_name: str) -> np.ndarray:
    """Heights of a terrain height sensor, ``[B, F]`` m."""
    return np.array(env.scene[sensor_name].data.heights)


@checked
def foot_contact(env: Any, sensor_name: str) -> np.ndarray:
    """1 for each contact, otherwise 0: float32 ``[B, N]``."""
    return (env.scene[sensor_name].data.found > 0).astype(np.float32)


@checked
def foot_contact_forces(env: Any, sensor_name: str) -> np.ndarray:
    """Contact forces, compressed per component to sign(F) log(1 + |F|): ``[B, 3 N]``."""
    force = env.scene[sensor_name].data.force
    return (np.sign(force) * np.log1p(np.abs(force))).reshape(len(force), -1)


@checked
def foot_air_time(env: Any, sensor_name: str) -> np.ndarray:
    """Current air time, ``[B, P]`` s."""
    return np.array(env.scene[sensor_name].data.current_air_time)
