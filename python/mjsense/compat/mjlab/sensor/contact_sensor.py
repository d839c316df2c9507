# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sensor.contact_sensor``: contact forces, contact points and times of contact and air."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mjsense.compat.mjlab._tensors import tensor
from mjsense.compat.mjlab.sensor.sensor import NativeSensor, SensorCfg
from mjsense.sensors import configs


@dataclass
class ContactMatch:
    """One side of a contact."""

    mode: str
    pattern: str | tuple[str, ...]
    entity: str | None = None
    exclude: tuple[str, ...] = ()

    def native(self) -> configs.ContactMatch:
        return configs.ContactMatch(**vars(self))


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

    def build(self) -> ContactSensor:
        return ContactSensor(self)


@dataclass
class ContactData:
    """Like :class:`mjsense.sensors.ContactData`; fields that were not requested are None."""

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


class ContactSensor(NativeSensor[ContactData]):
    """``data`` is a :class:`ContactData`."""

    _data_class = ContactData

    @property
    def primary_names(self) -> list[str]:
        """Names of the primaries in the order of the columns."""
        return list(self.native.primary_names)

    def compute_first_contact(self, dt: float, abs_tol: float = 1e-6) -> Any:
        """Which primaries touched down within the last ``dt`` seconds, bool ``[B, P]``."""
        return tensor(self.native.compute_first_contact(dt, abs_tol))

    def compute_first_air(self, dt: float, abs_tol: float = 1e-6) -> Any:
        """Which primaries took off within the last ``dt`` seconds, bool ``[B, P]``."""
        return tensor(self.native.compute_first_air(dt, abs_tol))
