# SPDX-License-Identifier: Apache-2.0
"""``mjlab.scene``: entities, terrain and sensors."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco

import mjsense
from mjsense import _core
from mjsense.compat.mjlab._entity_data import EntityData
from mjsense.compat.mjlab._tensors import ids, tensor
from mjsense.compat.mjlab.entity import Entity, EntityCfg
from mjsense.compat.mjlab.sensor import (
    BuiltinSensor,
    CameraSensor,
    CameraSensorCfg,
    RayCastSensor,
    Sensor,
    SensorCfg,
    SensorContext,
)
from mjsense.compat.mjlab.sensor.sensor import GivenSensor, OwnSensor, native_sensor
from mjsense.compat.mjlab.terrains import TerrainEntityCfg
from mjsense.core import mujoco_names
from mjsense.core.errors import UnknownNameError
from mjsense.sensors import configs


@dataclass(kw_only=True)
class SceneCfg:
    """Configuration of a scene, which all worlds share."""

    num_envs: int = 1
    env_spacing: float = 2.0
    terrain: TerrainEntityCfg | None = None
    entities: dict[str, EntityCfg] = field(default_factory=dict)
    sensors: tuple[SensorCfg | Sensor[Any] | mjsense.Sensor, ...] = ()
    """Configurations or user-defined sensors."""
    extent: float | None = None
    spec_fn: Callable[[mujoco.MjSpec], None] | None = None

    def _edit(self, spec: mujoco.MjSpec) -> None:
        if self.terrain is not None:
            self.terrain.edit_scene(spec)
        if self.spec_fn is not None:
            self.spec_fn(spec)
        for cfg in self.sensors:
            if isinstance(cfg, CameraSensorCfg) and cfg.camera_name is not None and cfg.fovy is not None:
                camera = spec.camera(cfg.camera_name)  # None: the scene says which there are
                if camera is not None:
                    camera.fovy = cfg.fovy

    def native(self) -> configs.SceneCfg:
        """The equivalent mjsense configuration, checked. Builds user-defined sensors."""
        return configs.SceneCfg(
            num_envs=self.num_envs,
            env_spacing=self.env_spacing,
            terrain=None if self.terrain is None else self.terrain.native(),
            entities={name: entity.native() for name, entity in self.entities.items()},
            sensors=tuple(native_sensor(sensor, self.entities) for sensor in self.sensors),
            extent=self.extent,
            spec_fn=self._edit,
            options=configs.MujocoCfg(),
        )


_SCENES: weakref.WeakValueDictionary[int, Scene] = weakref.WeakValueDictionary()
"""By the identity of the model or spec that they gave out, which they keep."""


def scene_of(given: Any) -> Scene:
    """The scene that returned this model or spec from ``compile()`` or ``spec``. Raises ValueError if there is none."""
    scene = _SCENES.get(id(given))
    if scene is None or not (given is scene.native.model or given is scene.native.spec):
        raise ValueError("Simulation: model must be what scene.compile() returned, or spec scene.spec")
    return scene


def _wrapped(native: Any, cfg: Any) -> Sensor[Any]:
    """The public sensor object of a sensor of the native scene."""
    if isinstance(native, OwnSensor):
        return native.original
    if isinstance(native, mjsense.Sensor):
        return GivenSensor(native)
    sensor = BuiltinSensor(cfg, native.name) if cfg is None else cfg.build()
    sensor.native = native
    return sensor


class Scene:
    """``scene[name]`` is a sensor or an entity. ``native`` is the :class:`mjsense.Scene` that does the work."""

    def __init__(self, scene_cfg: SceneCfg, device: str = "cpu") -> None:
        self._cfg = scene_cfg
        self._device = str(device)
        self._simulation: Any = None
        self.native = mjsense.Scene(scene_cfg.native())
        by_name = {cfg.prefixed_name: cfg for cfg in scene_cfg.sensors if isinstance(cfg, SensorCfg)}
        self._sensors = {name: _wrapped(sensor, by_name.get(name)) for name, sensor in self.native.sensors.items()}
        cameras = [sensor for sensor in self._sensors.values() if isinstance(sensor, CameraSensor)]
        for camera in cameras:
            camera.camera_idx = mujoco_names.name2id(self.native.model, mujoco_names.Obj.CAMERA, camera.camera_name)
        rays = [sensor for sensor in self._sensors.values() if isinstance(sensor, RayCastSensor)]
        self._context = SensorContext(cameras, rays) if cameras or rays else None
        self._entities = {
            name: Entity(e, scene_cfg.entities.get(name, scene_cfg.terrain)) for name, e in self.native.entities.items()
        }
        _SCENES[id(self.native.model)] = _SCENES[id(self.native.spec)] = self

    def __getitem__(self, key: str) -> Any:
        if key in self.sensors:
            return self.sensors[key]
        if key in self._entities:
            return self._entities[key]
        raise UnknownNameError(_core.unknown_name("scene", "sensor or entity", str(key), [*self._entities, *self.sensors]))

    @property
    def sensors(self) -> dict[str, Any]:
        """Configured sensors, then those of the entities' XML."""
        return self._sensors

    @property
    def entities(self) -> dict[str, Entity]:
        """Entities by name; the terrain, if any, is first."""
        return self._entities

    @property
    def terrain(self) -> Entity | None:
        """The terrain, or None."""
        return self._entities.get("terrain") if self._cfg.terrain is not None else None

    @property
    def spec(self) -> mujoco.MjSpec:
        return self.native.spec

    @property
    def num_envs(self) -> int:
        """B."""
        return self._cfg.num_envs

    @property
    def env_spacing(self) -> float:
        """m."""
        return self._cfg.env_spacing

    @property
    def env_origins(self) -> Any:
        """float32 ``[B, 3]`` m."""
        origins = tensor(self.native.env_origins(self.num_envs))
        return origins.to(self._device) if hasattr(origins, "to") else origins

    @property
    def device(self) -> str:
        return self._device

    @property
    def sensor_context(self) -> SensorContext | None:
        """None if there are no cameras and ray sensors."""
        return self._context

    def compile(self) -> mujoco.MjModel:
        """The model for a simulation. It was compiled at construction."""
        return self.native.model

    def initialize(self, mj_model: Any = None, model: Any = None, data: Any = None) -> None:
        """Has no effect: the simulation initializes the sensors."""

    def update(self, dt: float) -> None:
        """Updates air times and histories. Call after a physics step."""
        if self._simulation is not None:
            self._simulation.update_sensors(dt)
        for sensor in self._sensors.values():
            sensor._kept = None

    def reset(self, env_ids: Any = None) -> None:
        """Resets the sensors, and the targets of entities, of these worlds, by default of all."""
        if self._simulation is not None:
            self._simulation.reset_sensors(ids(env_ids))
            for entity in self._entities.values():
                entity.reset(env_ids)
        for sensor in self._sensors.values():
            sensor._kept = None

    def write_data_to_sim(self) -> None:
        """Writes the targets of the entities' actuators to their controls. Call it before a physics step."""
        for entity in self._entities.values():
            entity.write_data_to_sim()

    def _begin(self, simulation: Any) -> None:
        """The worlds exist."""
        self._simulation = simulation
        for entity in self._entities.values():
            entity._data = EntityData(entity, simulation)


__all__ = ["Scene", "SceneCfg"]
