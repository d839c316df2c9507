# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.camera_sensor``: images."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from mjsense.compat.mjlab.sensor.sensor import NativeSensor, SensorCfg
from mjsense.sensors import configs


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

    def build(self) -> CameraSensor:
        return CameraSensor(self)


@dataclass
class CameraSensorData:
    """Images ``[B, H, W, C]``: rgb uint8, depth float32 m, segmentation int32 (id, type)."""

    rgb: Any = None
    depth: Any = None
    segmentation: Any = None


class CameraSensor(NativeSensor[CameraSensorData]):
    """``data`` is a :class:`CameraSensorData`."""

    _data_class = CameraSensorData

    def __init__(self, cfg: Any = None, name: str | None = None) -> None:
        super().__init__(cfg, name)
        self.camera_idx = -1
        """Id of the camera in the model; -1 before the scene is made."""

    @property
    def camera_name(self) -> str:
        """Name of the camera in the model."""
        return self.cfg.camera_name or self.cfg.name
