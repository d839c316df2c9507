# SPDX-License-Identifier: Apache-2.0
"""Inertial measurement units."""

from typing import TYPE_CHECKING

from mjsense.sensors.configs import ImuAxis, ImuModel, ImuSensorCfg
from mjsense.sensors.data import ImuData
from mjsense.sensors.native_sensor import NativeSensor


class ImuSensor(NativeSensor):
    """An IMU; ``data`` is an :class:`mjsense.sensors.ImuData`."""

    if TYPE_CHECKING:

        @property
        def data(self) -> ImuData: ...


__all__ = ["ImuAxis", "ImuData", "ImuModel", "ImuSensor", "ImuSensorCfg"]
