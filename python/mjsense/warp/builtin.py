# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's own sensors: views of mujoco_warp's sensordata."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
from mujoco_warp._src import types

from mjsense.core import mujoco_names
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, implements, unsupported

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor


@implements("builtin")
class Builtin(WarpSensor):
    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        model = worlds.compiled.model
        index = mujoco_names.name2id(model, mujoco_names.Obj.SENSOR, sensor.name)
        if "history" in sensor.specs:
            raise unsupported(sensor.name, f"nsample = {sensor.specs['history'].shape[0]}")
        self.needs = Stage(int(model.sensor_needstage[index]))
        begin, dim = int(model.sensor_adr[index]), int(model.sensor_dim[index])
        (name,) = sensor.specs
        self.fields = {name: worlds.data.sensordata[:, begin : begin + dim]}


def check_types(model: Any) -> None:
    """Raises ValueError with all sensors whose types mujoco_warp lacks."""
    known = {int(kind) for kind in types.SensorType}
    missing = [
        f"'{model.sensor(i).name}' ({mujoco.mjtSensor(kind).name.removeprefix('mjSENS_').lower()})"
        for i, kind in enumerate(model.sensor_type)
        if int(kind) not in known
    ]
    if missing:
        raise ValueError(f"sensors whose types are not available with backend='warp': {', '.join(missing)}; use backend='cpu'")
