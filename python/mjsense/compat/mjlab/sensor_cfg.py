# SPDX-License-Identifier: Apache-2.0
"""mjlab's sensor configurations: plain and mutable; ``native()`` is what they mean here, checked."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

from mjsense import configs


@dataclass
class ObjRef:
    """One MuJoCo element."""

    type: str
    name: str
    entity: str | None = None

    def prefixed_name(self) -> str:
        """``entity/name``, or the name alone."""
        return f"{self.entity}/{self.name}" if self.entity else self.name

    def native(self) -> configs.ObjRef:
        return configs.ObjRef(type=self.type, name=self.name, entity=self.entity)


@dataclass
class ContactMatch:
    """One side of a contact."""

    mode: str
    pattern: str | tuple[str, ...]
    entity: str | None = None
    exclude: tuple[str, ...] = ()

    def native(self) -> configs.ContactMatch:
        return configs.ContactMatch(**vars(self))  # type: ignore[arg-type]


@dataclass
class SensorCfg:
    """Base of all."""

    name: str

    @property
    def prefixed_name(self) -> str:
        """Key in the scene."""
        return self.name

    def native(self) -> Any:
        """What the scene is made of; ValueError or TypeError where the configuration makes no sense."""
        raise NotImplementedError(f"{type(self).__name__} has no counterpart: derive from mjsense.Sensor instead")


@dataclass
class BuiltinSensorCfg(SensorCfg):
    """One of MuJoCo's sensors."""

    sensor_type: str
    obj: ObjRef | None = None
    ref: ObjRef | None = None
    cutoff: float = 0.0

    @property
    def prefixed_name(self) -> str:
        """``entity/name`` for an entity's."""
        return f"{self.obj.entity}/{self.name}" if self.obj is not None and self.obj.entity is not None else self.name

    def native(self) -> configs.BuiltinSensorCfg:
        obj, ref = (None if r is None else r.native() for r in (self.obj, self.ref))
        return configs.BuiltinSensorCfg(name=self.name, sensor_type=self.sensor_type, obj=obj, ref=ref, cutoff=self.cutoff)


@dataclass
class ContactSensorCfg(SensorCfg):
    """Contacts of primaries."""

    primary: ContactMatch
    secondary: ContactMatch | None = None
    fields: tuple[str, ...] = ("found", "force")
    reduce: str = "maxforce"
    num_slots: int = 1
    secondary_policy: str = "first"
    track_air_time: bool = False
    global_frame: bool = False
    history_length: int = 0
    debug: bool = False

    def native(self) -> configs.ContactSensorCfg:
        values = {**vars(self), "primary": self.primary.native()}
        values["secondary"] = None if self.secondary is None else self.secondary.native()
        return configs.ContactSensorCfg(**values)


@dataclass
class GridPatternCfg:
    """Parallel rays from a grid."""

    size: tuple[float, float] = (1.0, 1.0)
    resolution: float = 0.1
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    def native(self) -> configs.GridPatternCfg:
        return configs.GridPatternCfg(**vars(self))


@dataclass
class PinholeCameraPatternCfg:
    """Rays of a camera."""

    width: int = 16
    height: int = 12
    fovy: float = 45.0
    _camera_name: str | None = field(default=None, repr=False)

    @classmethod
    def from_mujoco_camera(cls, camera_name: str) -> PinholeCameraPatternCfg:
        """Resolution and angles of a camera of the model."""
        return cls(width=0, height=0, fovy=0.0, _camera_name=camera_name)

    @classmethod
    def from_intrinsic_matrix(cls, intrinsic_matrix: list[float], width: int, height: int) -> PinholeCameraPatternCfg:
        """Of a 3x3 matrix as 9 numbers, only fy is used."""
        return cls(width=width, height=height, fovy=math.degrees(2 * math.atan(height / (2 * intrinsic_matrix[4]))))

    def native(self) -> configs.PinholeCameraPatternCfg:
        if self._camera_name is not None:
            return configs.PinholeCameraPatternCfg(camera_name=self._camera_name)
        return configs.PinholeCameraPatternCfg(width=self.width, height=self.height, fovy=self.fovy)


@dataclass
class RingPatternCfg:
    """Parallel rays from circles."""

    @dataclass
    class Ring:
        """One circle."""

        radius: float
        num_samples: int

    rings: tuple[Ring, ...]
    include_center: bool = True
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    @classmethod
    def single_ring(cls, radius: float = 0.1, num_samples: int = 8, include_center: bool = True,
                    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)) -> RingPatternCfg:  # fmt: skip
        """One circle."""
        return cls((cls.Ring(radius, num_samples),), include_center, direction)

    def native(self) -> configs.RingPatternCfg:
        rings = tuple(configs.RingPatternCfg.Ring(r.radius, r.num_samples) for r in self.rings)
        return configs.RingPatternCfg(rings=rings, include_center=self.include_center, direction=self.direction)


@dataclass
class RayCastSensorCfg(SensorCfg):
    """Rays from frames."""

    @dataclass
    class VizCfg:
        """How rays are drawn."""

        hit_color: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 0.8)
        miss_color: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.4)
        hit_sphere_color: tuple[float, float, float, float] = (0.0, 1.0, 1.0, 1.0)
        hit_sphere_radius: float = 0.5
        show_rays: bool = False
        show_normals: bool = False
        normal_color: tuple[float, float, float, float] = (1.0, 1.0, 0.0, 1.0)
        normal_length: float = 5.0

        def native(self) -> configs.RayCastVizCfg:
            return configs.RayCastVizCfg(
                show_rays=self.show_rays, show_normals=self.show_normals, ray_color=self.hit_color, miss_color=self.miss_color,
                hit_color=self.hit_sphere_color, hit_radius=self.hit_sphere_radius, normal_color=self.normal_color,
                normal_length=self.normal_length)  # fmt: skip

    frame: ObjRef | tuple[ObjRef, ...]
    pattern: Any = field(default_factory=GridPatternCfg)
    ray_alignment: str = "base"
    max_distance: float = 10.0
    exclude_parent_body: bool = True
    include_geom_groups: tuple[int, ...] | None = (0, 1, 2)
    debug_vis: bool = False
    viz: VizCfg = field(default_factory=VizCfg)

    def native(self) -> configs.RayCastSensorCfg:
        frames = (self.frame,) if isinstance(self.frame, ObjRef) else self.frame
        if not frames:
            raise ValueError(f"sensor '{self.name}': frame is empty: name the bodies, sites or geoms that its rays start from")
        values = {**vars(self), "frame": tuple(f.native() for f in frames), "pattern": self.pattern.native(), "viz": self.viz.native()}
        return self._native_class(**values)

    _native_class = configs.RayCastSensorCfg


@dataclass
class TerrainHeightSensorCfg(RayCastSensorCfg):
    """Heights above the ground."""

    reduction: str = "min"

    _native_class = configs.TerrainHeightSensorCfg


@dataclass
class CameraSensorCfg(SensorCfg):
    """A camera of the model, or a new one."""

    camera_name: str | None = None
    parent_body: str | None = None
    pos: tuple[float, float, float] = (0.0, 0.0, 1.0)
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    fovy: float | None = None
    width: int = 160
    height: int = 120
    data_types: tuple[str, ...] = ("rgb",)
    use_textures: bool = True
    use_shadows: bool = False
    enabled_geom_groups: tuple[int, ...] = (0, 1, 2)
    orthographic: bool = False
    clone_data: bool = False

    def __post_init__(self) -> None:
        if not self.data_types:
            raise ValueError(f"sensor '{self.name}': data_types is empty: 'rgb', 'depth' and 'segmentation' can be had")

    def native(self) -> configs.CameraSensorCfg:
        return configs.CameraSensorCfg(**{f.name: getattr(self, f.name) for f in dataclasses.fields(self)})
