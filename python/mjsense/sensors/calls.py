# SPDX-License-Identifier: Apache-2.0
"""How mjsense calls a sensor: ``compute(sim, world_ids)`` and the methods of its life. Adapters call classes that are written for
other libraries in the same way."""

from __future__ import annotations

import weakref
from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from mjsense.core.later_rooms import provided
from mjsense.sensors.user_code import SensorError, named, takes

if TYPE_CHECKING:
    from mjsense.sensors.drawing import DebugShapes


class Values(NamedTuple):
    """The values of these worlds, computed at once: ``[len(world_ids), ...]``."""

    of_worlds: Any
    world_ids: list[int]


class EachWorld(NamedTuple):
    """Values that are computed one world at a time, when they are taken: ``(world, value)``, or an error instead of the value."""

    values: Generator[tuple[int, Any]]
    method: str
    """Name of the method for errors."""


class Calls:
    """Calls a sensor that computes all worlds with one instance, :meth:`mjsense.Sensor.compute`."""

    by_world = False
    """Whether the value of each world is computed by itself; :meth:`compute` then returns :class:`EachWorld`."""

    def __init__(self, sensor: Any) -> None:
        self._sensor = weakref.ref(sensor)  # which keeps this object

    @property
    def sensor(self) -> Any:
        """The sensor that is called."""
        return self._sensor()

    def edit_spec(self, scene: Any) -> None:
        """Before the compilation of this scene."""
        with named(self.sensor.uuid, "edit_spec"):
            self.sensor.edit_spec(scene.spec)

    def prepare(self, sim: Any) -> None:
        """Before :meth:`initialize`; raises TypeError or SensorError if the sensor cannot serve all worlds."""
        if sim.num_worlds > 1 and not takes(self.sensor.reset, 1):
            raise TypeError(f"sensor '{self.sensor.uuid}': one instance computes all worlds, so its reset() must take world_ids")

    def initialize(self, sim: Any) -> None:
        """After compilation."""
        with named(self.sensor.uuid, "initialize"):
            self.sensor.initialize(sim)

    def probe(self, sim: Any) -> Any:
        """A first value of world 0 before the sensor is added to the simulation; None if the sensor cannot give one."""

    def compute(self, sim: Any, world_ids: list[int], seeds: Sequence[int] = ()) -> Values | EachWorld:
        """The values of these worlds, or of all of them."""
        compute: Any = self.sensor.compute
        with named(self.sensor.uuid, "compute"):
            if takes(compute, 2):
                return Values(compute(sim, list(world_ids)), world_ids)
            return Values(compute(sim), list(range(sim.num_worlds)))

    def observe(self, env: Any, task: Any, world: int) -> Any:
        """The current value of one world for this task."""
        return self.sensor._mjs_row(world)

    def update(self, sim: Any, world_ids: list[int], dt: float, seeds: Sequence[int] = ()) -> list[tuple[int, SensorError]]:
        """After a control step of these worlds. Returns (world, error) of those that failed."""
        update: Any = self.sensor.update
        with named(self.sensor.uuid, "update"):
            update(dt, world_ids) if takes(update, 2) else update(dt)
        return []

    def reset(self, world_ids: list[int], num_worlds: int, seeds: Sequence[int] = ()) -> None:
        """When episodes begin in these worlds."""
        with named(self.sensor.uuid, "reset"):
            if not takes(self.sensor.reset, 1):
                self.sensor.reset()
            else:
                self.sensor.reset(None if len(world_ids) == num_worlds else world_ids)

    def draw(self, shapes: DebugShapes) -> None:
        """Adds the shapes of the world ``shapes.env_idx``."""
        with named(self.sensor.uuid, "debug_vis"):
            self.sensor.debug_vis(shapes)


def calls_of(sensor: Any) -> Calls:
    """The calls of a sensor: those of the first adapter that fits its class, otherwise the usual ones."""
    for adapter in provided("sensor_adapters"):
        if adapter.fits(sensor):
            return adapter(sensor)
    return Calls(sensor)
