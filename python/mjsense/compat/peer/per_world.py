# SPDX-License-Identifier: Apache-2.0
"""Sensors that compute one world at a time, with one instance for each world, as in MolmoSpaces:
``get_observation(env, task, batch_index)``."""

from __future__ import annotations

import copy
from collections.abc import Generator, Iterator, Sequence
from typing import Any

from mjsense.compat import mjlab_methods
from mjsense.sensors.calls import Calls, EachWorld
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.user_code import RandomStreams, SensorError, named, parameters, required, takes


def observe(instance: Any, env: Any, task: Any, world: int) -> Any:
    """Calls get_observation() like MolmoSpaces."""
    function = instance.get_observation
    names = {p.name for p in parameters(function)}
    if "batch_index" in names or any(p.kind is p.VAR_KEYWORD for p in parameters(function)):
        return function(env, task, batch_index=world)
    return function(env, task)


class PerWorldCalls(Calls):
    """Calls a :class:`mjsense.Sensor` with ``get_observation`` instead of ``compute``."""

    by_world = True

    def __init__(self, sensor: Any) -> None:
        super().__init__(sensor)
        self.instances: list[Any] = []
        """The instance of each world."""
        self._faults: dict[int, SensorError] = {}  # of reset(), raised when the value is computed

    @classmethod
    def fits(cls, sensor: Sensor) -> bool:
        return sensor._mjs_overrides("get_observation") and not (
            sensor._mjs_overrides("compute") or hasattr(sensor, "_compute_data")
        )

    @property
    def first(self) -> Any:
        """The object that the user gave."""
        return self.sensor

    @property
    def shared(self) -> bool:
        """Whether one instance serves all worlds."""
        return self.sensor._mjs_stateless or (self.sensor._mjs_overrides("reset") and takes(self.sensor.reset, 1))

    def edit_spec(self, scene: Any) -> None:
        mjlab_methods.edit_spec(self.sensor, scene)

    def prepare(self, sim: Any) -> None:
        self._faults = {}
        if self.shared:
            self.instances = [self.first] * sim.num_worlds
        elif len(self.instances) != sim.num_worlds:
            self.instances = [self.first, *(self._copy(sim) for _ in range(1, sim.num_worlds))]

    def _copy(self, sim: Any) -> Any:
        """A copy of the sensor for another world. References to the simulation and its parts are not copied."""
        kept = [sim, sim.scene, *sim.scene.sensors.values(), *sim._python]
        kept += [value for name, value in vars(self.sensor).items() if name.startswith("_mjs_")]
        kept.append(getattr(self.first, "observation_space", None))
        if "model" in vars(sim.scene):
            kept.append(sim.scene.model)
        kept += sim._models.copies()
        memo = {id(thing): thing for thing in kept if thing is not self.first}
        try:
            return copy.deepcopy(self.first, memo)
        except Exception as error:
            raise SensorError(
                f"sensor '{self.sensor.uuid}': one instance a world is needed, and it cannot be copied "
                f"({type(error).__name__}: {error}); give it a __deepcopy__, or a reset(world_ids) that keeps its state by world"
            ) from error

    def initialize(self, sim: Any) -> None:
        for instance in self.instances[:1] if self.shared else self.instances:
            mjlab_methods.initialize(instance, sim, self.sensor.uuid)

    def probe(self, sim: Any) -> Any:
        instance = self._copy(sim)
        with sim.env._computing_sensors() as env:
            env.current_batch_index = 0
            return observe(instance, env, env.task, 0)

    def _each(self, sim: Any, world_ids: list[int], seeds: Sequence[int], occasion: int) -> Iterator[tuple[Any, int]]:
        """The worlds, each with its own random numbers while it is used, and their environment."""
        with sim.env._computing_sensors() as env, RandomStreams(seeds, world_ids, occasion) as streams:
            for world in world_ids:
                env.current_batch_index = world
                streams.seed(world)
                yield env, world

    def compute(self, sim: Any, world_ids: list[int], seeds: Sequence[int] = ()) -> EachWorld:
        def values() -> Generator[tuple[int, Any]]:
            for env, world in self._each(sim, world_ids, seeds, 0):
                yield world, self._value(env, world)

        return EachWorld(values(), "get_observation")

    def _value(self, env: Any, world: int) -> Any:
        if world in self._faults:
            return self._faults.pop(world)
        try:
            with named(self.sensor.uuid, "get_observation", world):
                return observe(self.instances[world], env, env.task, world)
        except SensorError as error:
            return error

    def observe(self, env: Any, task: Any, world: int) -> Any:
        return observe(self.instances[world] if self.instances else self.first, env, task, world)

    def update(self, sim: Any, world_ids: list[int], dt: float, seeds: Sequence[int] = ()) -> list[tuple[int, SensorError]]:
        if self.shared:
            with named(self.sensor.uuid, "update"):
                self.first.update(*((dt, world_ids) if takes(self.first.update, 2) else (dt,)))
            return []
        faults = []
        for _, world in self._each(sim, world_ids, seeds, 2):
            try:
                with named(self.sensor.uuid, "update", world):
                    self.instances[world].update(dt)
            except SensorError as error:
                faults.append((world, error))
        return faults

    def reset(self, world_ids: list[int], num_worlds: int, seeds: Sequence[int] = ()) -> None:
        if self.shared:
            return super().reset(world_ids, num_worlds, seeds)
        with RandomStreams(seeds, world_ids, 1) as streams:
            for world in world_ids:
                reset = getattr(self.instances[world], "reset", None)
                self._faults.pop(world, None)
                streams.seed(world)
                try:
                    with named(self.sensor.uuid, "reset", world):
                        if reset is not None:
                            reset()
                except SensorError as error:
                    self._faults[world] = error

    def draw(self, shapes: DebugShapes) -> None:
        with named(self.sensor.uuid, "debug_vis"):
            (self.instances[shapes.env_idx] if self.instances else self.first).debug_vis(shapes)


class ForeignCalls(PerWorldCalls):
    """Calls an object that is no :class:`mjsense.Sensor`. It has no ``edit_spec`` or ``initialize``."""

    @property
    def first(self) -> Any:
        return self.sensor.original

    @property
    def shared(self) -> bool:
        reset = getattr(self.first, "reset", None)
        return reset is not None and bool(required(reset))

    def edit_spec(self, scene: Any) -> None:
        pass

    def initialize(self, sim: Any) -> None:
        pass

    def reset(self, world_ids: list[int], num_worlds: int, seeds: Sequence[int] = ()) -> None:
        if not self.shared:
            return super().reset(world_ids, num_worlds, seeds)
        with named(self.sensor.uuid, "reset"):
            self.first.reset(world_ids)


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
        return self._mjs_calls.observe(env, task, batch_index)

    def _mjs_original(self) -> Any:
        return self.original

    def _mjs_make_calls(self) -> Calls:
        return ForeignCalls(self)

    def _mjs_updates(self) -> bool:
        update = getattr(self.original, "update", None)
        return callable(update) and len(required(update)) == 1


def foreign_sensor(thing: Any) -> ForeignSensor | None:
    """Wraps an object that has a uuid and get_observation(); None for others."""
    if callable(getattr(thing, "get_observation", None)) and isinstance(getattr(thing, "uuid", None), str):
        return ForeignSensor(thing)
    return None
