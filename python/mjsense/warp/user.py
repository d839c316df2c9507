# SPDX-License-Identifier: Apache-2.0
"""Sensors written in Python: functions of tensors on the device."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from mjsense.core.arrays import on_host
from mjsense.sensors.row_declarations import leaves, nested, rows_of_space
from mjsense.sensors.user_code import named
from mjsense.warp import arrays
from mjsense.warp.sensor import DTYPES, Stage, WarpSensor, Worlds, unsupported

if TYPE_CHECKING:
    from mjsense.sensors.sensor import Sensor


class UserSensor(WarpSensor):
    """Calls a sensor's methods with the simulation on the device. Without an observation space its value is kept as it is."""

    needs = Stage.NONE  # it reads the simulation, which computes what is read
    on_host = True

    def __init__(self, worlds: Worlds, sensor: Sensor, sim: Any, reader: Any) -> None:
        self.worlds, self.name, self.cfg, self.sensor, self._sim = worlds, sensor.uuid, None, sensor, weakref.ref(sim)
        if sensor._mjs_calls.by_world:
            raise unsupported(self.name, "get_observation(), which computes one world at a time,")
        if sensor.is_dict:
            raise unsupported(self.name, "is_dict = True")
        self._rows = rows_of_space(sensor.observation_space)
        self.fields = {row.name: worlds.zeros((worlds.num_worlds, *row.shape), DTYPES[row.dtype.name]) for row in self._rows}
        shared = [arrays.share(self.fields[row.name]) for row in self._rows]
        sensor._mjs_core, sensor._mjs_sim_ref = reader, weakref.ref(sim)
        sensor._mjs_fields, sensor._mjs_rows = self._rows, shared or None
        sensor._mjs_shown = sensor._mjs_value = nested(self._rows, shared) if self._rows else None
        self._started = False

    def _simulation(self) -> Any:
        return self._sim()

    def initialize(self) -> None:
        """Called when the simulation is complete."""
        self.sensor._mjs_calls.initialize(self._simulation())
        self._started = True

    def update(self) -> None:
        sensor: Any = self.sensor
        sim = self._simulation()
        value = sensor._mjs_calls.compute(sim, list(range(sim.num_worlds))).of_worlds
        with named(self.name, "compute"):
            if not self._rows:
                sensor._mjs_value = value
                return
            for row, leaf in zip(self._rows, leaves(value, self._rows)):
                self._store(row, leaf)

    def _store(self, row: Any, value: Any) -> None:
        array = self.fields[row.name]
        shape = tuple(value.shape) if hasattr(value, "shape") else np.shape(value)
        dtype = str(value.dtype).removeprefix("torch.") if hasattr(value, "detach") else ""
        if shape != array.shape or (dtype and dtype != row.dtype.name):
            raise ValueError(f"a value of shape {shape} {dtype}, and the observation_space has {array.shape} {row.dtype.name}")
        if isinstance(value, wp.array):
            wp.copy(array, value)
        else:
            arrays.write(array, value)

    def substep(self) -> None:
        """After a control step."""
        if self.sensor._mjs_updates():
            self.sensor._mjs_calls.update(self._simulation(), list(range(self.worlds.num_worlds)), self.worlds.step_dt)

    def reset(self, mask: Any) -> None:
        if not self._started:
            return
        worlds: Sequence[int] = np.flatnonzero(on_host(mask)).tolist()
        if worlds:
            self.sensor._mjs_calls.reset(worlds, self.worlds.num_worlds)
