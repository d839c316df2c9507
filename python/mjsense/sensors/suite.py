# SPDX-License-Identifier: Apache-2.0
"""Sensor suites: what a policy observes and what a recording stores."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import gymnasium

from mjsense.core.arguments import KnownAttributes, checked
from mjsense.core.arrays import ids_of_worlds
from mjsense.core.errors import UnknownNameError, printable
from mjsense.sensors.given_sensor import as_sensor
from mjsense.sensors.sensor import Sensor


@checked
class SensorSuite(KnownAttributes):
    """An ordered set of sensors with unique names.

    ``suite.get_observations(sim)`` returns the arrays of all worlds ``[B, ...]`` without copying; ``suite.get_observations(env,
    task, batch_index)`` returns copies for one world, as in MolmoSpaces.
    """

    def __init__(self, sensors: Iterable[Any] = ()) -> None:
        self.sensors: dict[str, Any] = {}
        self._complete = True
        self.extend(sensors)

    def add(self, sensor: Any) -> None:
        """Adds a sensor of the scene, of the core suite, a user-defined one, or one written for MolmoSpaces. Raises ValueError
        for a sensor without a name, and if the name is in use."""
        sensor = as_sensor(sensor)
        uuid = sensor.uuid
        if not uuid:
            raise ValueError(f"{type(sensor).__name__} has no uuid")
        if uuid in self.sensors:
            raise ValueError(f"'{uuid}' is a duplicated sensor uuid")
        self.sensors[uuid] = sensor

    def extend(self, sensors: Iterable[Any]) -> None:
        """Adds several sensors in order. If a name is in use, the sensors before it stay added."""
        for sensor in sensors:
            self.add(sensor)

    def __repr__(self) -> str:
        return printable(f"<suite of {len(self.sensors)} sensors: {', '.join(self.sensors)}>")

    def _repr_html_(self) -> str:
        """HTML for notebooks: the representation of each sensor."""
        return "".join(sensor._repr_html_() for sensor in self.sensors.values())

    def get(self, uuid: str) -> Any:
        """The sensor of this name."""
        if uuid not in self.sensors:
            raise UnknownNameError(f"no sensor '{uuid}' in the suite; there are {', '.join(self.sensors) or 'none'}")
        return self.sensors[uuid]

    __getitem__ = get

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.sensors)

    def __contains__(self, uuid: object) -> bool:
        return uuid in self.sensors

    def __iter__(self) -> Iterator[Any]:
        return iter(self.sensors.values())

    def __len__(self) -> int:
        return len(self.sensors)

    @property
    def observation_spaces(self) -> gymnasium.spaces.Dict:
        """Space of one world's observation."""
        return gymnasium.spaces.Dict({uuid: s.observation_space for uuid, s in self.sensors.items()})

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """Calls reset() of the sensors that are written in Python."""
        for sensor in self.sensors.values():
            if isinstance(sensor, Sensor):
                worlds = sensor.simulation.num_worlds
                sensor._mjs_reset(list(range(worlds)) if world_ids is None else ids_of_worlds(world_ids, worlds).tolist())

    def get_observations(self, env: Any, task: Any = None, batch_index: int | None = None) -> dict[str, Any]:
        """Returns a new dict of observations in the suite's order.

        Args:
            env: A Simulation, or any object with one as its ``sim``.
            task: Task object that is passed to get_observation() of sensors that have this method. Without a task their value is
                that of ``data``, computed once per state.
            batch_index: Id of one world; by default all worlds.
        """
        sim = getattr(env, "sim", env)
        if not hasattr(sim, "refresh"):
            raise TypeError(
                f"SensorSuite.get_observations(): env must be a Simulation, or an object with one as its sim, not {env!r:.100}"
            )
        add_missing(sim, self.sensors.values())
        if batch_index is None:
            sim.refresh(list(self.sensors.values()))
            return {uuid: sensor.data for uuid, sensor in self.sensors.items()}
        if not 0 <= batch_index < sim.num_worlds:
            raise ValueError(f"batch_index {batch_index}: must be in [0, {sim.num_worlds})")
        out = {}
        for uuid, sensor in self.sensors.items():
            if not isinstance(sensor, Sensor):
                out[uuid] = sensor._row(batch_index)
            elif task is None:
                out[uuid] = sensor._mjs_row(batch_index)
            else:
                out[uuid] = sensor._mjs_calls.observe(sim.env if env is sim else env, task, batch_index)
        return out


def add_missing(sim: Any, sensors: Iterable[Any]) -> None:
    """Adds those sensors to the simulation that belong to none yet."""
    for sensor in sensors:
        if (sensor._mjs_core if isinstance(sensor, Sensor) else sensor._core) is None:
            sim.add(sensor)
