# SPDX-License-Identifier: Apache-2.0
"""The base class of sensors, and sets of them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from mjsense.sensors import suite
from mjsense.sensors.sensor import Sensor


class CoreSensor(Sensor):
    """A sensor of mjsense's core suite, computed in C++. In a task's suite it represents the core sensor with this uuid."""

    optional = False
    """The sensor is omitted if the task does not have it."""

    def __init__(self, uuid: str | None = None, **kwargs: Any) -> None:
        super().__init__(uuid, gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64))

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError(
            f"sensor '{self.uuid}' is computed by the environment of a task: read it there, or with task.get_observations()"
        )


class SensorSuite(suite.SensorSuite):
    """A suite that raises AssertionError, as MolmoSpaces does, if a name is in use."""

    def add(self, sensor: Any) -> None:
        """Adds a sensor."""
        if (uuid := getattr(sensor, "uuid", None)) in self.sensors:
            raise AssertionError(f"'{uuid}' is a duplicated sensor uuid")
        super().add(sensor)


__all__ = ["Sensor", "SensorSuite"]
