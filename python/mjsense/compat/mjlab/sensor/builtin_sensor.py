# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.builtin_sensor``: MuJoCo's own sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mjsense.compat.mjlab.sensor.sensor import NativeSensor, SensorCfg
from mjsense.sensors import configs


@dataclass
class ObjRef:
    """One MuJoCo element."""

    type: str
    name: str
    entity: str | None = None

    def prefixed_name(self) -> str:
        """``entity/name``, or the name if there is no entity."""
        return f"{self.entity}/{self.name}" if self.entity else self.name

    def native(self) -> configs.ObjRef:
        return configs.ObjRef(type=self.type, name=self.name, entity=self.entity)


@dataclass
class BuiltinSensorCfg(SensorCfg):
    """One of MuJoCo's sensors."""

    sensor_type: str
    obj: ObjRef | None = None
    ref: ObjRef | None = None
    cutoff: float = 0.0

    @property
    def prefixed_name(self) -> str:
        """``entity/name`` for a sensor of an entity."""
        return f"{self.obj.entity}/{self.name}" if self.obj is not None and self.obj.entity is not None else self.name

    def native(self) -> configs.BuiltinSensorCfg:
        obj, ref = (None if r is None else r.native() for r in (self.obj, self.ref))
        return configs.BuiltinSensorCfg(name=self.name, sensor_type=self.sensor_type, obj=obj, ref=ref, cutoff=self.cutoff)

    def build(self) -> BuiltinSensor:
        return BuiltinSensor(self)


class BuiltinSensor(NativeSensor[Any]):
    """``data`` is a tensor ``[B, n]``."""
