"""Inertial measurement units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mjsense._field_docs import show_field_docs
from mjsense.configs import Config, ObjRef, SensorCfg
from mjsense.data import SensorData
from mjsense.sensor import NativeSensor


@dataclass(frozen=True)
class ImuAxis(Config):
    """Half of a device, in m/s^2 or rad/s. Tolerances are three standard deviations, drawn anew for each episode."""

    noise_density: float = 0.0
    """unit / sqrt(Hz)."""
    bias_tolerance: Sequence[float] = (0.0, 0.0, 0.0)
    """unit, for x, y, z: turn-on bias."""
    scale_tolerance: float = 0.0
    cross_axis_tolerance: float = 0.0
    range: float = 0.0
    """unit, +-; 0: unlimited."""
    resolution: float = 0.0
    """unit of one count; 0: continuous."""
    bias_drift: float = 0.0
    """unit, standard deviation of a Gauss-Markov bias."""
    bias_drift_time_s: float = 0.0


@dataclass(frozen=True)
class ImuModel(Config):
    """What a data sheet says of a device; what it does not say is 0."""

    accelerometer: ImuAxis = ImuAxis()
    gyroscope: ImuAxis = ImuAxis()


@dataclass
class ImuSensorCfg(SensorCfg):
    """Accelerometer and gyroscope at a site, with the errors of a device. ``data`` is an :class:`mjsense.ImuData`.

    The clean values are the built-in sensors ``<name>_acc`` and ``<name>_gyro``.
    """

    kind: ClassVar[str] = "imu"
    site: ObjRef | None = None
    preset: str = "ideal"
    """ideal, mpu6050 (InvenSense PS-MPU-6000A-00 rev. 3.4), icm42688p (TDK DS-000347 rev. 1.7); "": model."""
    model: ImuModel = ImuModel()
    """Used if preset is ""."""
    orientation: bool = False
    """Also the site's orientation, without errors."""
    effects: Sequence[Any] = ()
    """After those of the device: delay, rate, dropout."""


@dataclass(slots=True, repr=False, frozen=True)
class ImuData(SensorData):
    """In the axes of the site."""

    acc: np.ndarray | None = None
    """[B, 3] m/s^2, specific force: +9.81 along up at rest, 0 in free fall."""
    gyro: np.ndarray | None = None
    """[B, 3] rad/s."""
    quat: np.ndarray | None = None
    """[B, 4] wxyz, of the site in the world; with orientation=True."""


class ImuSensor(NativeSensor):
    """An IMU; ``data`` is an :class:`mjsense.ImuData`."""

    _data_type = ImuData


show_field_docs(__name__)
