# SPDX-License-Identifier: Apache-2.0
"""Sensors of other libraries as mjsense's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.user_code import named, observe, required


class ForeignSensor(Sensor):
    """Wraps a sensor written for MolmoSpaces: any object with a uuid and ``get_observation(env, task, batch_index)``."""

    def __init__(self, original: Any) -> None:
        self.original = original
        """The wrapped object, which belongs to world 0."""
        self.uuid = original.uuid
        self.observation_space = getattr(original, "observation_space", None)
        self.is_dict = bool(getattr(original, "is_dict", False))
        self.str_max_len = int(getattr(original, "str_max_len", Sensor.str_max_len))
        self.unit, self.frame = str(getattr(original, "unit", "")), str(getattr(original, "frame", ""))

    def __repr__(self) -> str:
        return f"<{type(self.original).__name__} '{self.uuid}'>"

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        instance = self._mjs_instances[batch_index] if self._mjs_instances else self.original
        return observe(instance, env, task, batch_index)

    def _mjs_original(self) -> Any:
        return self.original

    def _mjs_by_world(self) -> bool:
        return True

    def _mjs_is_shared(self) -> bool:
        reset = getattr(self.original, "reset", None)
        return reset is not None and bool(required(reset))

    def _mjs_reset(self, world_ids: list[int], seeds: Sequence[int] = ()) -> None:
        if not self._mjs_is_shared():
            return super()._mjs_reset(world_ids, seeds)
        with named(self.uuid, "reset"):
            self.original.reset(world_ids)

    def _mjs_call(self, instance: Any, method: str, first: Any, owner: Any) -> None:
        """Does nothing: such an object has no edit_spec or initialize."""

    def _mjs_updates(self) -> bool:
        update = getattr(self.original, "update", None)
        return callable(update) and len(required(update)) == 1


def as_sensor(thing: Any) -> Any:
    """Returns an mjsense sensor, wrapping one of another library if necessary; raises TypeError for other objects."""
    if isinstance(thing, (Sensor, NativeSensor)):
        return thing
    if isinstance(thing, type):
        raise TypeError(f"not a sensor but a class: make one, {thing.__name__}(...)")
    if callable(getattr(thing, "get_observation", None)) and isinstance(getattr(thing, "uuid", None), str):
        return ForeignSensor(thing)
    raise TypeError(f"not a sensor: {thing!r} is not a mjsense.Sensor, nor has it a uuid and get_observation(env, task, batch_index)")


def list_of_sensors(made: Any) -> list[Any]:
    """The result of a user's ``sensors()``."""
    if not hasattr(made, "__iter__"):
        raise TypeError(f"sensors() must return a list of sensors, not {made!r:.100}")
    return list(made)
