# SPDX-License-Identifier: Apache-2.0
"""Objects that users give as sensors."""

from __future__ import annotations

from typing import Any

from mjsense.core.later_rooms import provided
from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.sensor import Sensor


def as_sensor(thing: Any) -> Any:
    """Returns an mjsense sensor, wrapping one of another library if necessary; raises TypeError for other objects."""
    if isinstance(thing, (Sensor, NativeSensor)):
        return thing
    if isinstance(thing, type):
        raise TypeError(f"not a sensor but a class: make one, {thing.__name__}(...)")
    if (wrapped := provided("foreign_sensor")(thing)) is not None:
        return wrapped
    raise TypeError(
        f"not a sensor: {thing!r} is not a mjsense.Sensor, nor has it a uuid and get_observation(env, task, batch_index)"
    )


def list_of_sensors(made: Any) -> list[Any]:
    """The result of a user's ``sensors()``."""
    if not hasattr(made, "__iter__"):
        raise TypeError(f"sensors() must return a list of sensors, not {made!r:.100}")
    return list(made)
