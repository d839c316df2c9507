# SPDX-License-Identifier: Apache-2.0
"""Sensors that trace rays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mjsense import _core
from mjsense._arguments import checked
from mjsense.data import CameraData, RayCastData
from mjsense.native_sensor import NativeSensor


class RayCastSensor(NativeSensor):
    """Rays from frames; ``data`` is a :class:`mjsense.RayCastData`."""

    if TYPE_CHECKING:

        @property
        def data(self) -> RayCastData: ...

    @property
    def num_frames(self) -> int:
        """F."""
        return _core.ray_counts(self._handle)[0]

    @property
    def num_rays_per_frame(self) -> int:
        """n, known once the simulation exists."""
        return _core.ray_counts(self._handle)[1]

    @property
    def num_rays(self) -> int:
        """R = F * n."""
        return self.num_frames * self.num_rays_per_frame


class TerrainHeightSensor(RayCastSensor):
    """Height above the ground below its frames, ``data.heights``."""


@checked
class LidarSensor(RayCastSensor):
    """A lidar: ``data.points``, ``data.intensity`` and all of a RayCastSensor's."""

    def write_point_cloud(self, path: str | Path, world: int = 0) -> None:
        """The returns of one world, in the sensor's frame, as .ply or .pcd."""
        data: Any = self.data
        if not 0 <= world < len(data.points):
            raise ValueError(f"world {world}: must be in [0, {len(data.points)})")
        _core.write_point_cloud(str(path), data.points[world], data.intensity[world], data.distances[world])


class CameraSensor(NativeSensor):
    """Images; ``data`` is a :class:`mjsense.CameraData`."""

    @property
    def data(self) -> CameraData:
        """The present images."""
        data = super().data
        if self.cfg is None or not self.cfg.clone_data:
            return data
        return replace(data, **{name: array.copy() for name, array in self._fields.items()})
