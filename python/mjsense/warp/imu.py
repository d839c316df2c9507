# SPDX-License-Identifier: Apache-2.0
"""IMUs: MuJoCo's accelerometer and gyroscope at a site, with the errors of a device."""

from __future__ import annotations

from math import radians
from typing import TYPE_CHECKING, Any

from mjsense.core import mujoco_names
from mjsense.sensors import effects
from mjsense.sensors.configs import ImuAxis, ImuModel
from mjsense.warp.effect_sensor import ChainSensor
from mjsense.warp.effects import Chain, needs_every_step
from mjsense.warp.sensor import Stage, Worlds, declared, implements

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

_G = 9.80665  # m/s^2
PRESETS = {
    "ideal": ImuModel(),
    "mpu6050": ImuModel(
        accelerometer=ImuAxis(400e-6 * _G, (0.050 * _G, 0.050 * _G, 0.080 * _G), 0.03, 0.02, 16 * _G, _G / 2048),
        gyroscope=ImuAxis(radians(0.005), (radians(20),) * 3, 0.03, 0.02, radians(2000), radians(1) / 16.4),
    ),
    "icm42688p": ImuModel(
        accelerometer=ImuAxis(noise_density=70e-6 * _G, range=16 * _G, resolution=16 * _G / 32768),
        gyroscope=ImuAxis(noise_density=radians(2.8e-3), range=radians(2000), resolution=radians(2000) / 32768),
    ),
}
"""The models of ``sensors/imu/imu_preset.cc``, which names their data sheets."""


def effects_of(axis: ImuAxis) -> list[Any]:
    """The effects of an accelerometer or gyroscope, in the order of the signal path."""
    chain: list[Any] = []
    if axis.scale_tolerance > 0 or axis.cross_axis_tolerance > 0:
        chain.append(effects.Misalignment(scale_error_std=axis.scale_tolerance / 3, angle_std=axis.cross_axis_tolerance / 3))
    if any(bias > 0 for bias in axis.bias_tolerance):
        chain.append(effects.EpisodeBias(effects.Gaussian([bias / 3 for bias in axis.bias_tolerance])))
    if axis.bias_drift > 0:
        chain.append(effects.BiasDrift(std=axis.bias_drift, time_constant_s=axis.bias_drift_time_s))
    if axis.noise_density > 0:
        chain.append(effects.Noise.with_density(axis.noise_density))
    if axis.range > 0:
        chain.append(effects.Clip.saturation(axis.range))
    if axis.resolution > 0:
        chain.append(effects.Quantize(axis.resolution))
    return chain


@implements("imu")
class Imu(ChainSensor):
    needs = Stage.ACC

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        self.fields = declared(worlds, sensor)
        model, cfg = worlds.compiled.model, self.cfg
        device = PRESETS[cfg.preset] if cfg.preset else cfg.model
        errors = {"acc": [*effects_of(device.accelerometer), *cfg.effects], "gyro": [*effects_of(device.gyroscope), *cfg.effects]}
        self.chains = []
        for part, out in self.fields.items():
            begin = int(model.sensor_adr[mujoco_names.name2id(model, mujoco_names.Obj.SENSOR, f"{self.name}_{part}")])
            clean = worlds.data.sensordata[:, begin : begin + out.shape[1]]
            self.chains.append(Chain(worlds, errors.get(part, []), f"{self.name}/{part}", clean, out))
        self.every_step = needs_every_step(errors["acc"]) or needs_every_step(errors["gyro"])
