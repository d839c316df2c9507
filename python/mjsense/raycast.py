"""Sensors that trace rays."""

from __future__ import annotations

from mjsense.data import CameraData, RayCastData
from mjsense.sensor import NativeSensor


class RayCastSensor(NativeSensor):
    """Rays from frames; ``data`` is a :class:`mjsense.RayCastData`."""

    _data_type = RayCastData

    @property
    def num_frames(self) -> int:
        """F."""
        return self.specs["frame_pos_w"].shape[0]

    @property
    def num_rays(self) -> int:
        """R, of all frames together."""
        return self.specs["distances"].shape[0]

    @property
    def num_rays_per_frame(self) -> int:
        return self.num_rays // self.num_frames


class TerrainHeightSensor(RayCastSensor):
    """Height above the ground below its frames, ``data.heights``."""


class CameraSensor(NativeSensor):
    """Images; ``data`` is a :class:`mjsense.CameraData`."""

    _data_type = CameraData
