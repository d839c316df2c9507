# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's own sensors: views of mujoco_warp's sensordata."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mjsense import _mujoco
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, implements, unsupported

if TYPE_CHECKING:
    from mjsense.native_sensor import NativeSensor


@implements("builtin")
class Builtin(WarpSensor):
    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        model = worlds.compiled.model
        index = _mujoco.name2id(model, _mujoco.Obj.SENSOR, sensor.name)
        if "history" in sensor.specs:
            raise unsupported(sensor.name, f"nsample = {sensor.specs['history'].shape[0]}")
        self.needs = Stage(int(model.sensor_needstage[index]))
        begin, dim = int(model.sensor_adr[index]), int(model.sensor_dim[index])
        (name,) = sensor.specs
        self.fields = {name: worlds.data.sensordata[:, begin : begin + dim]}
