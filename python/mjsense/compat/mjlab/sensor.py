# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor``: configurations, what sensors return, and the sensors of a scene."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from mjsense.compat.mjlab._tensors import Cache, tensor
from mjsense.compat.mjlab.sensor_cfg import (
    BuiltinSensorCfg,
    CameraSensorCfg,
    ContactMatch,
    ContactSensorCfg,
    GridPatternCfg,
    ObjRef,
    PinholeCameraPatternCfg,
    RayCastSensorCfg,
    RingPatternCfg,
    SensorCfg,
    TerrainHeightSensorCfg,
)

PatternCfg = GridPatternCfg | PinholeCameraPatternCfg | RingPatternCfg


@dataclass
class ContactData:
    """As :class:`mjsense.ContactData`; fields that were not asked for are None."""

    found: Any = None
    force: Any = None
    torque: Any = None
    dist: Any = None
    pos: Any = None
    normal: Any = None
    tangent: Any = None
    current_air_time: Any = None
    last_air_time: Any = None
    current_contact_time: Any = None
    last_contact_time: Any = None
    force_history: Any = None
    torque_history: Any = None
    dist_history: Any = None


@dataclass
class RayCastData:
    """As :class:`mjsense.RayCastData`."""

    distances: Any
    normals_w: Any
    hit_pos_w: Any
    pos_w: Any
    quat_w: Any
    frame_pos_w: Any
    frame_quat_w: Any


@dataclass
class TerrainHeightData(RayCastData):
    """With the heights, ``[B, F]`` m, ``[B, F, n]`` without reduction."""

    heights: Any


@dataclass
class CameraSensorData:
    """Images ``[B, H, W, C]``: rgb uint8, depth float32 m, segmentation int32 (id, type)."""

    rgb: Any = None
    depth: Any = None
    segmentation: Any = None


class Sensor:
    """A sensor of a :class:`mjsense.compat.mjlab.scene.Scene`; ``native`` is ours. Its data are those of the state as it is now."""

    _data_class: type | None = None

    def __init__(self, native: Any, cfg: SensorCfg | None, name: str) -> None:
        self.native = native
        self.cfg: Any = cfg
        self.name = name
        self._tensors = Cache()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of mjlab: {self.native!r}>"

    @property
    def data(self) -> Any:
        """Tensors on the sensor's memory: valid until the next read after a change."""
        data = self.native.data
        if self._data_class is None:
            return self._tensors("", data)
        names = [field.name for field in dataclasses.fields(self._data_class)]
        return self._data_class(**{name: self._tensors(name, getattr(data, name)) for name in names})


class BuiltinSensor(Sensor):
    """``data`` is ``[B, n]``."""


class ContactSensor(Sensor):
    """``data`` is a :class:`ContactData`."""

    _data_class = ContactData

    @property
    def primary_names(self) -> list[str]:
        """In the order of the columns."""
        return list(self.native.primary_names)

    def compute_first_contact(self, dt: float, abs_tol: float = 1e-6) -> Any:
        """Which primaries touched down within the last ``dt`` seconds, bool ``[B, P]``."""
        return tensor(self.native.compute_first_contact(dt, abs_tol))

    def compute_first_air(self, dt: float, abs_tol: float = 1e-6) -> Any:
        """Which primaries took off within the last ``dt`` seconds, bool ``[B, P]``."""
        return tensor(self.native.compute_first_air(dt, abs_tol))


class RayCastSensor(Sensor):
    """``data`` is a :class:`RayCastData`."""

    _data_class = RayCastData

    @property
    def num_frames(self) -> int:
        """F."""
        return self.native.num_frames

    @property
    def num_rays_per_frame(self) -> int:
        """n."""
        return self.native.num_rays_per_frame


class TerrainHeightSensor(RayCastSensor):
    """``data`` is a :class:`TerrainHeightData`."""

    _data_class = TerrainHeightData


class CameraSensor(Sensor):
    """``data`` is a :class:`CameraSensorData`."""

    _data_class = CameraSensorData

    def __init__(self, native: Any, cfg: SensorCfg | None, name: str) -> None:
        super().__init__(native, cfg, name)
        self.camera_idx = -1
        """Of the camera in the model."""

    @property
    def camera_name(self) -> str:
        """Of the camera in the model."""
        return self.cfg.camera_name or self.cfg.name


class SensorContext:
    """The cameras and ray sensors of a scene. There is nothing to prepare: they are computed when they are read."""

    def __init__(self, camera_sensors: list[CameraSensor], raycast_sensors: list[RayCastSensor]) -> None:
        self.camera_sensors = sorted(camera_sensors, key=lambda sensor: sensor.camera_idx)
        self.raycast_sensors = raycast_sensors

    @property
    def has_cameras(self) -> bool:
        return bool(self.camera_sensors)

    @property
    def has_raycasts(self) -> bool:
        return bool(self.raycast_sensors)

    def prepare(self) -> None:
        """Nothing to do."""

    def finalize(self) -> None:
        """Nothing to do."""

    def get_rgb(self, cam_idx: int) -> Any:
        """uint8 ``[B, H, W, 3]`` of a camera of the model; KeyError if no sensor is there."""
        return self._image(cam_idx, "rgb")

    def get_depth(self, cam_idx: int) -> Any:
        """float32 ``[B, H, W, 1]`` m; KeyError if no sensor is there."""
        return self._image(cam_idx, "depth")

    def get_segmentation(self, cam_idx: int) -> Any:
        """int32 ``[B, H, W, 2]``; KeyError if no sensor is there."""
        return self._image(cam_idx, "segmentation")

    def _image(self, cam_idx: int, kind: str) -> Any:
        for sensor in self.camera_sensors:
            if sensor.camera_idx == cam_idx:
                image = getattr(sensor.data, kind)
                if image is None:
                    raise RuntimeError(f"sensor '{sensor.name}' has no {kind}: its data_types are {sensor.cfg.data_types}")
                return image
        raise KeyError(f"no sensor of camera {cam_idx}; there are those of {[s.camera_idx for s in self.camera_sensors]}")


SENSOR_CLASSES: dict[str, type[Sensor]] = {
    "camera": CameraSensor,
    "contact": ContactSensor,
    "raycast": RayCastSensor,
    "terrain_height": TerrainHeightSensor,
}
"""By the kind of ours; others are :class:`BuiltinSensor`."""

__all__ = [
    "BuiltinSensor",
    "BuiltinSensorCfg",
    "CameraSensor",
    "CameraSensorCfg",
    "CameraSensorData",
    "ContactData",
    "ContactMatch",
    "ContactSensor",
    "ContactSensorCfg",
    "GridPatternCfg",
    "ObjRef",
    "PatternCfg",
    "PinholeCameraPatternCfg",
    "RayCastData",
    "RayCastSensor",
    "RayCastSensorCfg",
    "RingPatternCfg",
    "Sensor",
    "SensorCfg",
    "SensorContext",
    "TerrainHeightData",
    "TerrainHeightSensor",
    "TerrainHeightSensorCfg",
]
