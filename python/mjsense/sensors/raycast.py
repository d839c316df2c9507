# SPDX-License-Identifier: Apache-2.0
"""Sensors that cast rays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mjsense import _core
from mjsense.core.arguments import checked
from mjsense.core.arrays import copied, on_host
from mjsense.sensors.data import CameraData, RayCastData
from mjsense.sensors.native_sensor import NativeSensor


class RayCastSensor(NativeSensor):
    """Rays cast from frames; ``data`` is a :class:`mjsense.sensors.RayCastData`."""

    if TYPE_CHECKING:

        @property
        def data(self) -> RayCastData: ...

    @property
    def num_frames(self) -> int:
        """Number of frames, ``F``."""
        return _core.ray_counts(self._handle)[0]

    @property
    def num_rays_per_frame(self) -> int:
        """Number of rays per frame, ``n``; known once the simulation is created."""
        return _core.ray_counts(self._handle)[1]

    @property
    def num_rays(self) -> int:
        """Number of rays, ``R = F * n``."""
        return self.num_frames * self.num_rays_per_frame


class TerrainHeightSensor(RayCastSensor):
    """Height of its frames above the ground, ``data.heights``."""


@checked
class LidarSensor(RayCastSensor):
    """A lidar: ``data.points``, ``data.intensity`` and all fields of a RayCastSensor."""

    def write_point_cloud(self, path: str | Path, world: int = 0) -> None:
        """Writes the returns of one world, in the sensor's frame, to a .ply or .pcd file."""
        data: Any = self.data
        if not 0 <= world < len(data.points):
            raise ValueError(f"world {world}: must be in [0, {len(data.points)})")
        _core.write_point_cloud(str(path), *(on_host(rows[world]) for rows in (data.points, data.intensity, data.distances)))


class CameraSensor(NativeSensor):
    """A camera; ``data`` is a :class:`mjsense.sensors.CameraData`."""

    @property
    def data(self) -> CameraData:
        """The current images."""
        data = super().data
        if self.cfg is None or not self.cfg.clone_data:
            return data
        return replace(data, **{name: copied(array) for name, array in self._fields.items()})
