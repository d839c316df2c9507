# SPDX-License-Identifier: Apache-2.0
"""The base class of sensors, and sets of them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from mjsense.sensors.sensor import Sensor
from mjsense.sensors.suite import SensorSuite


class CoreSensor(Sensor):
    """A sensor of mjsense's core suite, computed in C++. In a task's suite it represents the core sensor with this uuid."""

    optional = False
    """The sensor is omitted if the task does not have it."""

    def __init__(self, uuid: str | None = None, **kwargs: Any) -> None:
        super().__init__(uuid, gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64))

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError(f"sensor '{self.uuid}' is computed by the environment of a task: read it there, or with task.get_observations()")


__all__ = ["Sensor", "SensorSuite"]
