# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.sensor``: the base classes of sensors and of their configurations."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

import mjsense
from mjsense import _core
from mjsense.compat.mjlab._data import Data
from mjsense.compat.mjlab._tensors import HAS_TORCH, Cache, memory_of, tensor
from mjsense.compat.mjlab.entity import Entity

if TYPE_CHECKING:
    import mujoco

T = TypeVar("T")


@dataclass
class SensorCfg:
    """Base of all sensor configurations. A user-defined subclass implements ``build()``, which returns its :class:`Sensor`."""

    name: str

    @property
    def prefixed_name(self) -> str:
        """Key in the scene."""
        return self.name

    def build(self) -> Sensor[Any]:
        """The sensor of this configuration."""
        raise NotImplementedError(f"{type(self).__name__}: write build(), which returns a Sensor")


class Sensor(Generic[T]):
    """Base of the sensors of a :class:`mjsense.compat.mjlab.scene.Scene`; ``T`` is the type of ``data``.

    A user-defined subclass implements ``_compute_data()`` and, if needed, ``edit_spec``, ``initialize``, ``update`` and
    ``reset``. Its value is computed when it is read for the first time after a step, a ``forward()`` or a reset.
    """

    requires_sensor_context: bool = False
    """Has no effect: cameras and rays need no preparation."""
    native: Any = None
    """The sensor of the native scene that computes this one."""
    _invalid = False
    _kept: Any = None
    """The object that ``data`` of a native sensor returned last, until the next update or reset."""

    def __init__(self) -> None:
        """A subclass need not call this constructor."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of mjlab: {self.native!r}>"

    def edit_spec(self, scene_spec: mujoco.MjSpec, entities: dict[str, Entity]) -> None:
        """Adds MuJoCo elements before compilation. The entities have names only."""

    def initialize(self, mj_model: mujoco.MjModel, model: Any, data: Any, device: str) -> None:
        """Called once the simulation exists: resolve names, allocate.

        Args:
            mj_model, model: the compiled model, twice; with ``backend="warp"`` the second is mujoco_warp's.
            data: fields of mjData as tensors ``[B, ...]``: ``data.qpos``.
            device: "cpu", or that of ``backend="warp"``.
        """

    def update(self, dt: float) -> None:
        """Called for every ``scene.update(dt)``."""

    def reset(self, env_ids: Any = None) -> None:
        """Called when environments begin a new episode: a tensor of ids, or None for all."""

    def debug_vis(self, visualizer: mjsense.sensors.DebugShapes) -> None:
        """Draws the environment ``visualizer.env_idx``."""

    @property
    def data(self) -> T:
        """The value of all environments."""
        if self.native is None:
            raise RuntimeError(f"{type(self).__name__} has no data yet: it belongs to no scene")
        value = self.native.data
        if self._invalid:
            value = self.native.recompute()
        return value

    def _compute_data(self) -> T:
        raise NotImplementedError(f"{type(self).__name__}: write _compute_data()")

    def _invalidate_cache(self) -> None:
        """The next read computes the value again."""
        self._invalid = True


class NativeSensor(Sensor[T]):
    """Base of the sensors that mjsense computes: ``native`` has the arrays, ``data`` shows them as tensors on the same memory."""

    _data_class: type | None = None

    def __init__(self, cfg: Any = None, name: str | None = None) -> None:
        self.cfg = cfg
        self.name = name or (cfg.prefixed_name if cfg is not None else "")
        self._tensors = Cache()
        self._memory: list[Any] = []

    @property
    def data(self) -> T:
        """Tensors that share the sensor's memory. The first read after a change of state overwrites them."""
        if self.native is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: it belongs to no scene")
        source = self.native.data
        arrays = [source] if self._data_class is None else [getattr(source, name) for name in self._fields()]
        memory = [memory_of(array) for array in arrays]
        if self._kept is None or any(a is not b for a, b in zip(memory, self._memory)):
            self._kept, self._memory = self._compute_data(), memory
        return self._kept

    def update(self, dt: float) -> None:
        """The next ``data`` is another object. Its numbers never depend on this: they are always those of the current state."""
        self._kept = None

    def reset(self, env_ids: Any = None) -> None:
        """The next ``data`` is another object."""
        self._kept = None

    def _fields(self) -> list[str]:
        kind: Any = self._data_class
        return [field.name for field in dataclasses.fields(kind)]

    def _compute_data(self) -> Any:
        data = self.native.data
        if self._data_class is None:
            return self._tensors("", data)
        return self._data_class(**{name: self._tensors(name, getattr(data, name)) for name in self._fields()})


class GivenSensor(Sensor[Any]):
    """Wraps a :class:`mjsense.Sensor` of the scene: arrays are returned as tensors, all other attributes are those of the
    sensor."""

    def __init__(self, native: mjsense.Sensor) -> None:
        self.native = native
        self._tensors = Cache()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.native, name)

    @property
    def data(self) -> Any:
        """The sensor's value with arrays replaced by tensors."""
        return self._converted("", self.native.data)

    def _converted(self, name: str, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: self._converted(f"{name}/{key}", item) for key, item in value.items()}
        return self._tensors(name, value) if isinstance(value, np.ndarray) else value


class OwnSensor(mjsense.Sensor):
    """Runs a user's :class:`Sensor` in the native scene."""

    def __init__(self, original: Sensor[Any], name: str, entity_cfgs: dict[str, Any]) -> None:
        super().__init__(uuid=name)
        self.original = original
        self._entity_cfgs = entity_cfgs

    def edit_spec(self, spec: Any, entities: dict[str, Any]) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        self.original.edit_spec(spec, {name: Entity(e, self._entity_cfgs.get(name)) for name, e in entities.items()})

    def initialize(self, sim: mjsense.Simulation) -> None:
        on_warp: Any = sim
        self.original.initialize(
            sim.model, getattr(on_warp, "warp_model", sim.model), Data(sim), getattr(on_warp, "device", "cpu")
        )

    def compute(self, sim: mjsense.Simulation) -> Any:
        self.original._invalid = False
        value = self.original._compute_data()
        if value is None:
            raise ValueError("_compute_data() returned None")
        return tensor(value) if isinstance(value, np.ndarray) else value

    def recompute(self) -> Any:
        if isinstance(self._mjs_core, _core.Simulation):
            self._mjs_compute_rows(list(range(self.simulation.num_worlds)))
        else:
            self._mjs_core.refresh(self._mjs_handle, again=True)
        return self._mjs_value

    def update(self, dt: float) -> None:
        self.original.update(dt)

    def reset(self, world_ids: Any = None) -> None:
        self.original.reset(world_ids if world_ids is None or not HAS_TORCH else tensor(np.array(world_ids)))

    def debug_vis(self, visualizer: mjsense.sensors.DebugShapes) -> None:
        self.original.debug_vis(visualizer)

    def _mjs_updates(self) -> bool:
        return type(self.original).update is not Sensor.update


def native_sensor(item: Any, entity_cfgs: dict[str, Any]) -> Any:
    """Converts an element of ``SceneCfg.sensors`` to a configuration or sensor that the native scene accepts."""
    built: Any = item.build() if isinstance(item, SensorCfg) else item
    if isinstance(built, NativeSensor) and isinstance(item, SensorCfg):
        return item.native()  # pyright: ignore[reportAttributeAccessIssue]
    name = item.prefixed_name if isinstance(item, SensorCfg) else getattr(item, "name", "")
    if isinstance(built, mjsense.Sensor):
        built.uuid = name or built.uuid
        return built
    if not isinstance(built, Sensor):
        if isinstance(item, SensorCfg):
            raise TypeError(f"{type(item).__name__}.build() must return a Sensor, not {built!r}")
        return built  # a configuration of mjsense, or an object that the scene rejects
    if not name:
        raise ValueError(f"{type(built).__name__}: a sensor in SceneCfg.sensors needs a name; set its attribute 'name'")
    if built.native is not None:
        raise RuntimeError(f"sensor '{name}' belongs to another scene: make one for each")
    built.native = OwnSensor(built, name, entity_cfgs)
    return built.native
