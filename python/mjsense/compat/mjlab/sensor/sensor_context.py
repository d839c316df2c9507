# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.sensor_context``: the cameras and rays of a scene."""

from __future__ import annotations

from typing import Any

from mjsense.compat.mjlab.sensor.camera_sensor import CameraSensor
from mjsense.compat.mjlab.sensor.raycast_sensor import RayCastSensor


class SensorContext:
    """The cameras and ray sensors of a scene. They are computed when they are read, so nothing is prepared."""

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
        """Has no effect."""

    def finalize(self) -> None:
        """Has no effect."""

    def get_rgb(self, cam_idx: int) -> Any:
        """uint8 ``[B, H, W, 3]`` of a camera of the model; KeyError if the camera has no sensor."""
        return self._image(cam_idx, "rgb")

    def get_depth(self, cam_idx: int) -> Any:
        """float32 ``[B, H, W, 1]`` m; KeyError if the camera has no sensor."""
        return self._image(cam_idx, "depth")

    def get_segmentation(self, cam_idx: int) -> Any:
        """int32 ``[B, H, W, 2]``; KeyError if the camera has no sensor."""
        return self._image(cam_idx, "segmentation")

    def _image(self, cam_idx: int, kind: str) -> Any:
        for sensor in self.camera_sensors:
            if sensor.camera_idx == cam_idx:
                image = getattr(sensor.data, kind)
                if image is None:
                    raise RuntimeError(f"sensor '{sensor.name}' has no {kind}: its data_types are {sensor.cfg.data_types}")
                return image
        raise KeyError(f"no sensor of camera {cam_idx}; there are those of {[s.camera_idx for s in self.camera_sensors]}")
