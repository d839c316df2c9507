# SPDX-License-Identifier: Apache-2.0
"""Contact sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mjsense import _core
from mjsense.core.arguments import checked
from mjsense.sensors.data import ContactData
from mjsense.sensors.native_sensor import NativeSensor


@checked
class ContactSensor(NativeSensor):
    """Contacts of its primaries; ``data`` is a :class:`mjsense.sensors.ContactData`."""

    if TYPE_CHECKING:

        @property
        def data(self) -> ContactData: ...

    @property
    def primary_names(self) -> tuple[str, ...]:
        """Names of the primaries without prefix, in the order of the columns."""
        return _core.contact_primary_names(self._handle)

    @property
    def secondary_names(self) -> tuple[str, ...]:
        """Names of the secondaries without prefix."""
        return _core.contact_secondary_names(self._handle)

    def compute_first_contact(self, dt: float, abs_tol: float = 1e-6) -> np.ndarray:
        """Primaries that came into contact within the last `dt` seconds: bool ``[B, P]``. Requires track_air_time."""
        return self._first("contact", dt, abs_tol)

    def compute_first_air(self, dt: float, abs_tol: float = 1e-6) -> np.ndarray:
        """Primaries that lost contact within the last `dt` seconds: bool ``[B, P]``. Requires track_air_time."""
        return self._first("air", dt, abs_tol)

    def _first(self, phase: str, dt: float, abs_tol: float) -> np.ndarray:
        self.data  # update the sensor
        if isinstance(self._core, _core.Simulation):
            return _core.contact_first(self._handle, phase, dt, abs_tol)
        if "current_air_time" not in self._fields:
            raise RuntimeError(f"sensor '{self.name}' does not track air time: set track_air_time")
        time = self._fields[f"current_{phase}_time"]
        return (time > 0) & (time < dt + abs_tol)
