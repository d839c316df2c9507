# SPDX-License-Identifier: Apache-2.0
"""Scenes: everything that is shared by all worlds."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import mujoco_names, mujoco_views, representations
from mjsense.core.arguments import KnownAttributes, checked
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError
from mjsense.scene.read_only_model import read_only
from mjsense.sensors.configs import MujocoCfg, SceneCfg, SensorCfg
from mjsense.sensors.contact import ContactSensor
from mjsense.sensors.given_sensor import as_sensor
from mjsense.sensors.imu import ImuSensor
from mjsense.sensors.native_sensor import BuiltinSensor, NativeSensor
from mjsense.sensors.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.sensors.sensor import Sensor

if TYPE_CHECKING:
    import mujoco

_CLASSES = {
    "builtin": BuiltinSensor,
    "contact": ContactSensor,
    "imu": ImuSensor,
    "lidar": LidarSensor,
    "raycast": RayCastSensor,
    "terrain_height": TerrainHeightSensor,
    "camera": CameraSensor,
}


class Entity(KnownAttributes):
    """A model that is attached to the scene. Names of its elements are without its prefix, in model order."""

    def __init__(self, name: str, description: dict[str, Any]) -> None:
        self.name = name
        self.fixed_base: bool = description["fixed_base"]
        """True if the model has no free joint."""
        self.body_names: tuple[str, ...] = description["body_names"]
        self.geom_names: tuple[str, ...] = description["geom_names"]
        self.site_names: tuple[str, ...] = description["site_names"]
        self.joint_names: tuple[str, ...] = description["joint_names"]
        self.actuator_names: tuple[str, ...] = description["actuator_names"]
        self.tendon_names: tuple[str, ...] = description["tendon_names"]
        self.camera_names: tuple[str, ...] = description["camera_names"]
        self._complete = True

    def __repr__(self) -> str:
        return f"<entity '{self.name}': {counted(len(self.body_names), 'body')}, {counted(len(self.joint_names), 'joint')}>"

    def _repr_html_(self) -> str:
        """HTML for notebooks: the names of its elements."""
        kinds = ("body", "joint", "actuator", "geom", "site", "tendon", "camera")
        rows = [(kind, len(names), ", ".join(names)) for kind in kinds if (names := getattr(self, f"{kind}_names"))]
        return representations.block(f"entity '{self.name}'", representations.grid(("elements", "count", "names"), rows))


@checked
class Scene(KnownAttributes):
    """Entities, terrain and sensors, compiled into one model. ``scene[key]`` is a sensor or, if there is none of that name, an
    entity."""

    def __init__(self, cfg: SceneCfg) -> None:
        self._build(cfg)

    def _build(self, cfg: SceneCfg, *address: int) -> None:
        items, edit = self._prepare(cfg)
        self._core = _core.Scene.make(cfg, self.spec, items, edit, *address)
        self._finish()

    def _prepare(self, cfg: SceneCfg) -> tuple[list[Any], Callable[[], None]]:
        """Returns the arguments of the C++ scene in addition to the configuration and the spec: its sensors and the final
        edit."""
        cfg.__post_init__()  # it may have been changed after its construction
        self.cfg = cfg
        self.spec = cfg._base_spec()
        """The spec in which the scene is built."""
        self._simulation: Any = None
        items = [self._item(sensor) for sensor in cfg.sensors]
        for item in items:
            if isinstance(item, Sensor):
                if item._mjs_scene_ref is not None and item._mjs_scene_ref() is not None:
                    raise RuntimeError(f"sensor '{item.uuid}' belongs to another scene: make one for each")
                item._mjs_scene_ref = weakref.ref(self)

        def edit() -> None:
            if cfg.spec_fn is not None:
                cfg.spec_fn(self.spec)

        return items, edit

    def _finish(self) -> None:
        for text in self._core.warnings():
            warnings.warn(text, stacklevel=5)  # the line that makes the Scene
        self._register()

    def _set_options(self, options: MujocoCfg) -> None:
        """Replaces the physics options, including those of ``model``. Must be called before a simulation is created."""
        self._core.set_options(options, self.model._address)
        self.cfg.options = options

    @classmethod
    def _of(cls, core: Any, prepared: Scene | None = None) -> Scene:
        """Wraps a C++ scene that was created elsewhere, from the result of ``prepared``."""
        if prepared is not None:
            prepared._core = core
            prepared._finish()
            return prepared
        self = cls.__new__(cls)
        self.cfg, self.spec, self._core, self._simulation = SceneCfg(), None, core, None
        self._register()
        return self

    @classmethod
    def _of_model(cls, cfg: SceneCfg, address: int) -> Scene:
        """A scene over a copy of the compiled model at this address, with the sensors of `cfg`."""
        self = cls.__new__(cls)
        self._build(cfg, address)
        return self

    def _register(self) -> None:
        self._sensors: dict[str, Any] = {}
        for handle in self._core.sensors():
            own = handle.python_object()
            self._sensors[handle.name] = own if own is not None else _CLASSES.get(handle.kind, NativeSensor)(handle)
            if own is not None:
                own._mjs_handle = handle
        for sensor_cfg in self.cfg.sensors:
            if isinstance(sensor_cfg, SensorCfg) and not hasattr(sensor_cfg, "build"):
                self._sensors[sensor_cfg.prefixed_name].cfg = sensor_cfg
        self._complete = True

    @staticmethod
    def _item(sensor: Any) -> Any:
        """The object passed to C++: a configuration or a Sensor."""
        if isinstance(sensor, Sensor):
            return sensor
        if hasattr(sensor, "build"):
            built = sensor.build()
            if not isinstance(built, Sensor):
                raise TypeError(f"{type(sensor).__name__}.build() must return a mjsense.Sensor, not {built!r}")
            built.uuid = getattr(sensor, "prefixed_name", "") or built.uuid or sensor.name
            return built
        if isinstance(sensor, SensorCfg):
            return sensor
        if hasattr(sensor, "get_observation") and not isinstance(sensor, NativeSensor):
            return as_sensor(sensor)
        raise TypeError(f"sensors: neither a sensor configuration nor a mjsense.Sensor: {sensor!r}")

    def __repr__(self) -> str:
        return f"<scene: entities {list(self.entities)}, {counted(len(self._sensors), 'sensor')}>"

    def __getitem__(self, key: str) -> Any:
        if key in self._sensors:
            return self._sensors[key]
        if key in self.entities:
            return self.entities[key]
        raise UnknownNameError(_core.unknown_name("scene", "sensor or entity", str(key), [*self.entities, *self._sensors]))

    def builtin(self, name: str) -> BuiltinSensor:
        """``self[name]`` if it is one of MuJoCo's own sensors; raises TypeError for other kinds. The methods below behave
        likewise."""
        return self._of_class(name, BuiltinSensor)

    def contact(self, name: str) -> ContactSensor:
        """``self[name]`` as a contact sensor."""
        return self._of_class(name, ContactSensor)

    def raycast(self, name: str) -> RayCastSensor:
        """``self[name]`` as a ray-cast sensor."""
        return self._of_class(name, RayCastSensor)

    def terrain_height(self, name: str) -> TerrainHeightSensor:
        """``self[name]`` as a terrain height sensor."""
        return self._of_class(name, TerrainHeightSensor)

    def lidar(self, name: str) -> LidarSensor:
        """``self[name]`` as a lidar."""
        return self._of_class(name, LidarSensor)

    def camera(self, name: str) -> CameraSensor:
        """``self[name]`` as a camera."""
        return self._of_class(name, CameraSensor)

    def imu(self, name: str) -> ImuSensor:
        """``self[name]`` as an IMU."""
        return self._of_class(name, ImuSensor)

    def entity(self, name: str) -> Entity:
        """``self[name]`` as an entity."""
        if name not in self._sensors:
            return self[name]
        if name not in self.entities:
            raise TypeError(f"'{name}' is a sensor, not an entity")
        return self.entities[name]

    def _of_class(self, name: str, wanted: type[Any]) -> Any:
        found = self[name]
        if not isinstance(found, wanted):
            what = "an entity" if isinstance(found, Entity) else f"a {type(found).__name__}"
            raise TypeError(f"'{name}' is {what}, not a {wanted.__name__}")
        return found

    def __contains__(self, key: object) -> bool:
        return key in self._sensors or key in self.entities

    def _ipython_key_completions_(self) -> list[str]:
        return [*self._sensors, *self.entities]

    def _repr_html_(self) -> str:
        """HTML for notebooks: the configured sensors, then, folded, the sensors of the models' XML."""
        configured, found = [], []
        for sensor in self._sensors.values():
            (configured if isinstance(sensor, Sensor) or sensor.cfg is not None else found).append(sensor._repr_html_())
        return representations.block(
            repr(self), "".join(configured), {f"{counted(len(found), 'sensor')} of the models": "".join(found)} if found else None
        )

    @property
    def sensors(self) -> Mapping[str, Any]:
        """Configured sensors in their order, then those found in the entities' XML."""
        return MappingProxyType(self._sensors)

    @cached_property
    def entities(self) -> Mapping[str, Entity]:
        """Entities by name; the terrain, if any, comes first."""
        return MappingProxyType({name: Entity(name, names) for name, names in self._core.entities().items()})

    def _entities_of_spec(self) -> dict[str, Entity]:
        """The entities before compilation, with names only."""
        kinds = mujoco_names.Obj
        kinds = (kinds.BODY, kinds.GEOM, kinds.SITE, kinds.JOINT, kinds.ACTUATOR, kinds.TENDON, kinds.CAMERA)
        names = {kind.name.lower(): _core.spec_names(self.spec._address, kind) for kind in kinds}
        entities = {}
        for name in self.cfg.entities:
            prefix = name + "/"
            described: dict[str, Any] = {
                f"{kind}_names": tuple(name[len(prefix) :] for name in found if name.startswith(prefix))
                for kind, found in names.items()
            }
            described["fixed_base"] = "mocap_base" in described["body_names"]
            entities[name] = Entity(name, described)
        return entities

    @cached_property
    def model(self) -> mujoco.MjModel:
        """A read-only copy of the compiled model, for look-ups and MuJoCo's functions. ``copy.copy(scene.model)`` can be
        changed."""
        return read_only(mujoco_views.model_of(self._core.copy_model()))

    def to_xml(self) -> str:
        """MJCF that compiles to the same model. If ``assets()`` is not empty, write its files to the same folder."""
        return self._core.to_xml()

    def assets(self) -> dict[str, bytes]:
        """Files that were given to the scene as bytes, by name."""
        return self._core.assets()

    def env_origins(self, num_worlds: int | None = None) -> np.ndarray:
        """Origins of the worlds, float32 ``[B, 3]`` m: 0 without terrain, a grid on a plane."""
        return self._core.env_origins(self.cfg.num_envs if num_worlds is None else num_worlds)

    def env_tiles(self, num_worlds: int | None = None) -> np.ndarray | None:
        """(level, type) of the worlds' tiles, int32 ``[B, 2]``; None without generated terrain."""
        return self._core.env_tiles(self.cfg.num_envs if num_worlds is None else num_worlds)

    def tile_origins(self) -> np.ndarray | None:
        """Spawn points of the tiles, float32 ``[levels, types, 3]`` m; None without generated terrain."""
        return self._core.tile_origins()


def prepared(make: Callable[[], Any], context: str) -> tuple[Any, ...]:
    """Arguments from which C++ builds the scene of a rollout: the configuration that ``make`` returns, its spec, its sensors, the
    final edit, and the Scene."""
    cfg = make()
    if not isinstance(cfg, SceneCfg):
        raise TypeError(f"{context} must return a mjsense.SceneCfg, not {cfg!r}")
    scene: Scene = Scene.__new__(Scene)
    items, edit = scene._prepare(cfg)
    return cfg, scene.spec, items, edit, scene
