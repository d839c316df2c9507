# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.raycast_sensor``: rays from frames."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from mjsense.compat.mjlab.sensor.builtin_sensor import ObjRef
from mjsense.compat.mjlab.sensor.sensor import NativeSensor, SensorCfg
from mjsense.sensors import configs


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
        """Pattern of a 3x3 intrinsic matrix given as 9 numbers. Only fy is used."""
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
    def single_ring(
        cls,
        radius: float = 0.1,
        num_samples: int = 8,
        include_center: bool = True,
        direction: tuple[float, float, float] = (0.0, 0.0, -1.0),
    ) -> RingPatternCfg:
        """One circle."""
        return cls((cls.Ring(radius, num_samples),), include_center, direction)

    def native(self) -> configs.RingPatternCfg:
        rings = tuple(configs.RingPatternCfg.Ring(r.radius, r.num_samples) for r in self.rings)
        return configs.RingPatternCfg(rings=rings, include_center=self.include_center, direction=self.direction)


PatternCfg = GridPatternCfg | PinholeCameraPatternCfg | RingPatternCfg


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
                show_rays=self.show_rays,
                show_normals=self.show_normals,
                ray_color=self.hit_color,
                miss_color=self.miss_color,
                hit_color=self.hit_sphere_color,
                hit_radius=self.hit_sphere_radius,
                normal_color=self.normal_color,
                normal_length=self.normal_length,
            )

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
        values = {
            **vars(self),
            "frame": tuple(f.native() for f in frames),
            "pattern": self.pattern.native(),
            "viz": self.viz.native(),
        }
        return self._native_class(**values)

    _native_class = configs.RayCastSensorCfg

    def build(self) -> RayCastSensor:
        return RayCastSensor(self)


@dataclass
class RayCastData:
    """As :class:`mjsense.sensors.RayCastData`."""

    distances: Any
    normals_w: Any
    hit_pos_w: Any
    pos_w: Any
    quat_w: Any
    frame_pos_w: Any
    frame_quat_w: Any


class RayCastSensor(NativeSensor[RayCastData]):
    """``data`` is a :class:`RayCastData`."""

    _data_class = RayCastData

    @property
    def num_frames(self) -> int:
        """F."""
        return self.native.num_frames

    @property
    def num_rays(self) -> int:
        """F n."""
        return self.num_frames * self.num_rays_per_frame

    @property
    def num_rays_per_frame(self) -> int:
        """n."""
        return self.native.num_rays_per_frame
