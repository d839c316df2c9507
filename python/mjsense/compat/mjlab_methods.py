# SPDX-License-Identifier: Apache-2.0
"""Sensors with the methods of mjlab: ``edit_spec(spec, entities)``, ``initialize(mj_model, model, data, device)``,
``_compute_data()``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mjsense.sensors.calls import Calls, Values
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.user_code import named, required


def edit_spec(sensor: Sensor, scene: Any) -> None:
    """Calls edit_spec() with mjsense's arguments or, if it requires more, with mjlab's."""
    function: Any = sensor.edit_spec
    with named(sensor.uuid, "edit_spec"):
        function(scene.spec, scene._entities_of_spec()) if len(required(function)) == 2 else function(scene.spec)


def initialize(instance: Any, sim: Any, uuid: str) -> None:
    """Calls initialize() with mjsense's argument or, if it requires more, with mjlab's."""
    function = instance.initialize
    with named(uuid, "initialize"):
        if len(required(function)) == 4:
            function(sim.model, getattr(sim, "warp_model", sim.model), sim.data, getattr(sim, "device", "cpu"))
        else:
            function(sim)


class MjlabCalls(Calls):
    """Calls a :class:`mjsense.Sensor` of whose methods some are those of mjlab."""

    @classmethod
    def fits(cls, sensor: Sensor) -> bool:
        methods = len(required(sensor.edit_spec)) == 2 or len(required(sensor.initialize)) == 4
        return hasattr(sensor, "_compute_data") or (
            methods and (sensor._mjs_overrides("compute") or not sensor._mjs_overrides("get_observation"))
        )

    def edit_spec(self, scene: Any) -> None:
        edit_spec(self.sensor, scene)

    def initialize(self, sim: Any) -> None:
        initialize(self.sensor, sim, self.sensor.uuid)

    def compute(self, sim: Any, world_ids: list[int], seeds: Sequence[int] = ()) -> Any:
        if self.sensor._mjs_overrides("compute"):
            return super().compute(sim, world_ids, seeds)
        with named(self.sensor.uuid, "compute"):
            value = self.sensor._compute_data()
            if value is None:
                raise ValueError("_compute_data() returned None")
            return Values(value, list(range(sim.num_worlds)))
