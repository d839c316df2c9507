# SPDX-License-Identifier: Apache-2.0
"""Rows of sensors on the host, for a recorder: one transfer from the device a step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from mjsense.recording.written_rows import WrittenRows
from mjsense.sensors.sensor import Sensor


class HostRows:
    def __init__(self, sensors: Sequence[Any], fields: Sequence[Mapping[str, wp.array]], num_worlds: int, device: Any) -> None:
        """``fields``: the arrays of each sensor."""
        self._copies: list[tuple[wp.array, slice, np.ndarray]] = []
        streams, size = WrittenRows(num_worlds), 0
        for sensor, arrays in zip(sensors, fields):
            for name, array in arrays.items():
                rows = streams.add_spec(*stream_of(sensor, name))
                self._copies.append((array, slice(size, size + rows.nbytes), rows))
                size += -(-rows.nbytes // 16) * 16
        self.handles = streams.handles
        """C++ handles of the streams, which have the names, units and frames of those of a simulation on the CPU."""
        self._device = wp.empty(size, dtype=wp.uint8, device=device)
        self._host = wp.empty(size, dtype=wp.uint8, device="cpu", pinned=wp.get_device(device).is_cuda)

    def read(self) -> None:
        """Copies the current rows of all worlds."""
        for array, part, _ in self._copies:
            scalar = array.dtype
            shape = (math.prod(array.shape),)
            target = wp.array(ptr=self._device.ptr + part.start, dtype=scalar, shape=shape, device=self._device.device)
            wp.copy(target.reshape(array.shape), array)
        wp.copy(self._host, self._device)
        wp.synchronize_device(self._device.device)
        host = self._host.numpy()
        for _, part, rows in self._copies:
            rows[...] = host[part].view(rows.dtype).reshape(rows.shape)


def stream_of(sensor: Any, field: str) -> tuple[str, dict[str, Any]]:
    """Name and specification of the stream of a sensor's field."""
    if isinstance(sensor, Sensor):
        (spec,) = [spec for spec in sensor._mjs_row_specs() if spec["name"] == field]
    else:
        known = sensor.specs[field]
        names = ("dtype", "unit", "frame", "low", "high", "is_dict", "description")
        spec = {name: getattr(known, name) for name in names} | {"shape": list(known.shape)}
    stream = "/".join(part for part in (sensor.uuid, field) if part)
    if getattr(sensor, "kind", "") == "camera":
        stream = sensor.uuid if field == "rgb" else f"{sensor.uuid}_{field}"
        if field in ("rgb", "depth"):
            spec |= {"video": True, "shape": spec["shape"][: 3 if field == "rgb" else 2]}
    return stream, spec
