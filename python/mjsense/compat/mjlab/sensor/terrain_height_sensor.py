# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.terrain_height_sensor``: heights above the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mjsense.compat.mjlab.sensor.raycast_sensor import RayCastData, RayCastSensor, RayCastSensorCfg
from mjsense.sensors import configs


@dataclass
class TerrainHeightSensorCfg(RayCastSensorCfg):
    """Heights above the ground."""

    reduction: str = "min"

    _native_class = configs.TerrainHeightSensorCfg

    def build(self) -> TerrainHeightSensor:
        return TerrainHeightSensor(self)


@dataclass
class TerrainHeightData(RayCastData):
    """With the heights, ``[B, F]`` m, ``[B, F, n]`` without reduction."""

    heights: Any


class TerrainHeightSensor(RayCastSensor):
    """``data`` is a :class:`TerrainHeightData`."""

    _data_class = TerrainHeightData
