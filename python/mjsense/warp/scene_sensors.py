# SPDX-License-Identifier: Apache-2.0
"""The sensors of a simulation: made from those of its scene, and computed at most once for each state of the worlds."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType
from typing import Any

import warp as wp

from mjsense.sensors import data
from mjsense.sensors.sensor import Sensor
from mjsense.warp import arrays, builtin, camera, contact, effect_sensor, imu, lidar, physics, rays, terrain_height
from mjsense.warp.graphs import Graphs
from mjsense.warp.sensor import REGISTRY, Stage, WarpSensor, Worlds, unsupported
from mjsense.warp.stepper import Stepper
from mjsense.warp.user import UserSensor

# Each registers its sensors.
__all__ = [
    "SceneSensors",
    "builtin",
    "camera",
    "contact",
    "effect_sensor",
    "imu",
    "lidar",
    "rays",
    "terrain_height",
]


class SceneSensors:
    """The sensors by name, and the number of the state that each was computed for.

    The simulation calls :meth:`state_changed` with every change of the state. To the Python objects of the scene's sensors this
    object is what the C++ simulation is on the CPU: they call :meth:`refresh` before their arrays are read.
    """

    def __init__(self, sim: Any, worlds: Worlds, stepper: Stepper, graphs: Graphs) -> None:
        self._sim, self._worlds, self._stepper, self._graphs = sim, worlds, stepper, graphs
        self.by_name: dict[str, WarpSensor] = worlds.sensors
        self.meansize = float(sim.model.stat.meansize)
        self._state = 1
        self._state_of_forces = 0
        self._state_of: dict[str, int] = {}
        for name in list(sim.scene.sensors):
            self._make(name)
        for made in self.by_name.values():
            if made.every_step:
                self._use(made)
        stepper.substepped = [made for made in self.by_name.values() if made.wants_substep]
        stepper.substep_stage = max((made.needs for made in stepper.substepped), default=Stage.NONE)

    def _make(self, name: str) -> None:
        if name in self.by_name:
            return
        scene = self._sim.scene
        sensor: Any = scene.sensors[name]
        if isinstance(sensor, Sensor):
            self.by_name[name] = UserSensor(self._worlds, sensor, self._sim, self)
            return
        if sensor.kind == "contact_field" and not contact.has_field(self._worlds, name):
            del scene._sensors[name]
            return
        if sensor.kind == "effect":
            self._make(sensor.cfg.sensor)
        make = REGISTRY.get(sensor.kind)
        if make is None:
            raise unsupported(name, f"a sensor of kind {sensor.kind}")
        sensor._bind(self._worlds.compiled._core)  # so that its values in the compiled world can be read
        made = self.by_name[name] = make(self._worlds, sensor)
        sensor._core = self
        shared = {field: arrays.share(array) for field, array in made.fields.items()}
        sensor._fields = MappingProxyType(shared)
        sensor._data = shared[""] if "" in shared else data.make_data(data.DATA_OF_KIND.get(sensor.kind, data.SensorData), shared)

    def add(self, sensor: Sensor) -> None:
        """Adds a sensor that is not part of the scene."""
        if sensor._mjs_core is not None:
            raise RuntimeError(f"sensor '{sensor.uuid}' belongs to a simulation already")
        if sensor.uuid in self.by_name:
            raise ValueError(f"sensor '{sensor.uuid}': there is one of that name already")
        with wp.ScopedDevice(self._worlds.device):
            made = UserSensor(self._worlds, sensor, self._sim, self)
        made.initialize()
        self.by_name[sensor.uuid] = made

    @property
    def on_host(self) -> Iterator[WarpSensor]:
        """The sensors whose methods run Python code of the user."""
        return (sensor for sensor in self.by_name.values() if sensor.on_host)

    def initialize(self) -> None:
        """Calls initialize() of the user-defined sensors, when the simulation is complete."""
        for sensor in self.by_name.values():
            if isinstance(sensor, UserSensor):
                sensor.initialize()

    def state_changed(self, has_forces: bool = False) -> None:
        """``has_forces``: accelerations and forces belong to the new state."""
        self._state += 1
        if has_forces:
            self._state_of_forces = self._state

    def computed_by_step(self) -> None:
        """The current state was reached by a control step, which has computed the sensors in use."""
        used = self._stepper.used
        if self._stepper.substep_stage == Stage.ACC or any(sensor.needs == Stage.ACC for sensor in used):
            self._state_of_forces = self._state
        self._state_of.update((sensor.name, self._state) for sensor in used)

    def need_forces(self) -> None:
        """Computes accelerations and forces unless they belong to the current state."""
        if self._state_of_forces != self._state:
            with wp.ScopedDevice(self._worlds.device):
                physics.compute_forces(self._worlds.model, self._worlds.data)
            self._state_of_forces = self._state

    def refresh_every_step(self) -> None:
        """Computes the sensors that must be computed in each control step."""
        for sensor in self._stepper.used:
            if sensor.every_step:
                self.refresh(sensor)

    def refresh(self, handle: Any, again: bool = False) -> None:
        """Computes the sensor with the name of ``handle`` for the current state if it is not up to date, or ``again``."""
        self._sim._check_open()
        sensor = self.by_name[handle.name]
        if self._state_of.get(sensor.name) != self._state or again:
            self._compute(sensor)
        if (check := getattr(sensor, "check", None)) is not None:
            check()

    def _compute(self, sensor: WarpSensor) -> None:
        for source in sensor.inputs:
            self.refresh(source)
        with wp.ScopedDevice(self._worlds.device):
            if sensor.needs == Stage.ACC:
                self.need_forces()
            sensor.update()
        self._state_of[sensor.name] = self._state
        self._use(sensor)

    def _use(self, sensor: WarpSensor) -> None:
        """Computes this sensor with every step from now on."""
        for source in sensor.inputs:
            self._use(source)
        if sensor not in self._stepper.used and not sensor.on_host:
            self._stepper.used.append(sensor)
            self._graphs.clear()

    @property
    def closed(self) -> bool:
        return self._sim.closed

    def draw(self, *_: Any) -> Any:
        raise NotImplementedError("debug drawing is not available with backend='warp'; use backend='cpu'")
