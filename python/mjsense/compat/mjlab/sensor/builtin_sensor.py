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


_FRAMES = ("body", "xbody", "geom", "site", "camera")
_OF = {
    **dict.fromkeys(("accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer", "rangefinder"), ("site",)),
    **dict.fromkeys(("jointpos", "jointvel", "jointlimitpos", "jointlimitvel", "jointlimitfrc", "jointactuatorfrc"), ("joint",)),
    **dict.fromkeys(("tendonpos", "tendonvel", "tendonactuatorfrc"), ("tendon",)),
    **dict.fromkeys(("actuatorpos", "actuatorvel", "actuatorfrc"), ("actuator",)),
    **dict.fromkeys(("subtreecom", "subtreelinvel", "subtreeangmom"), ("body",)),
    **dict.fromkeys(
        (f"frame{x}" for x in ["pos", "quat", "xaxis", "yaxis", "zaxis", "linvel", "angvel", "linacc", "angacc"]), _FRAMES
    ),
}
"""Kind of sensor -> the kinds of elements that it can be attached to."""


@dataclass
class BuiltinSensorCfg(SensorCfg):
    """One of MuJoCo's sensors."""

    sensor_type: str
    obj: ObjRef | None = None
    ref: ObjRef | None = None
    cutoff: float = 0.0

    def __post_init__(self) -> None:
        """Checks the elements as mjlab does, with its words; all else is checked when the scene is made."""
        kinds = _OF.get(self.sensor_type)
        if kinds is not None and (self.obj is None or self.obj.type not in kinds):
            wanted = f"'{kinds[0]}'" if len(kinds) == 1 else f"one of {kinds}"
            text = f"obj with type={wanted}" if self.obj is None else f"obj.type={wanted}, not '{self.obj.type}'"
            raise ValueError(f"sensor '{self.name}': the type '{self.sensor_type}' requires {text}")
        if kinds is not _FRAMES and self.ref is not None:
            raise ValueError(f"sensor '{self.name}': the type '{self.sensor_type}' does not support ref specification")

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
