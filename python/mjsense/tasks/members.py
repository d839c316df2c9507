# SPDX-License-Identifier: Apache-2.0
"""User-defined sensors as members of a rollout's suite."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from mjsense.sensors.given_sensor import as_sensor
from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.sensor import Sensor

if TYPE_CHECKING:
    from mjsense.sim.simulation import Simulation


def member(thing: Any) -> Any:
    """Converts an object to a sensor that can join a suite; raises TypeError or ValueError if that is impossible."""
    sensor = as_sensor(thing)
    if isinstance(sensor, NativeSensor) and not hasattr(sensor, "_make"):
        raise ValueError(f"sensor '{sensor.uuid}' belongs to a scene: give its values as a sensor of your own")
    return sensor


def prepare(sim: Simulation, sensors: Iterable[Any] | Callable[[Simulation], Iterable[Any]]) -> list[Any]:
    """Objects that C++ adds to the suite: a Sensor, or the handle of a sensor that is computed in C++. The simulation keeps them
    alive."""
    members = []
    for sensor in map(member, sensors(sim) if callable(sensors) else sensors):
        if not isinstance(sensor, Sensor):
            members.append(sensor._make(sim))
            continue
        sensor._mjs_core = None  # it may have been used in a previous recording
        sensor._mjs_probe(sim)
        if not sensor._mjs_row_specs():
            raise ValueError(f"sensor '{sensor.uuid}' cannot be recorded: give it an observation_space, or is_dict = True")
        members.append(sensor)
        sim._python.append(sensor)
    return members
