# SPDX-License-Identifier: Apache-2.0
"""Python interface of the sensors that are computed in C++."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from mjsense import _core
from mjsense.core import representations
from mjsense.core.arguments import KnownAttributes, checked
from mjsense.core.arrays import copied, fresh, on_host
from mjsense.sensors import data
from mjsense.sensors.drawing import DebugShapes


@checked
class NativeSensor(KnownAttributes):
    """A sensor of the scene that is computed in C++."""

    def __init__(self, handle: _core.SensorHandle) -> None:
        self._handle = handle
        self._core: _core.Simulation | None = None
        self._data: Any = None
        self._fields: Mapping[str, np.ndarray] = {}
        self.name: str = handle.name
        """Key in the scene."""
        self.kind: str = handle.kind
        """Kind of sensor: ``"builtin"``, ``"contact"``, ``"raycast"``, ``"camera"`` ..."""
        self.cfg: Any = None
        """Its configuration; None for a sensor that was found in the model."""
        self._complete = True

    def __init_subclass__(cls) -> None:
        representations.help_of_objects(cls)

    def _help(self) -> str:
        return representations.help_text(type(self), self._shown())

    def __repr__(self) -> str:
        return representations.line(f"{self.kind} sensor '{self.name}'", self._shown())

    def _repr_html_(self) -> str:
        """HTML for notebooks: its fields, and thumbnails of the first world's images."""
        images = {}
        if self.kind == "camera" and self._core is not None and not self._core.closed:
            images = {name or self.name: on_host(rows[0]) for name, rows in self.fields.items() if rows.ndim == 4}
        return representations.table(f"{self.kind} sensor '{self.name}'", self._shown(), images)

    def _shown(self) -> list[representations.Row]:
        worlds = next((len(array) for array in self._fields.values()), None)
        return representations.rows_of(self.specs, worlds) if self._fields else []

    def _bind(self, core: _core.Simulation) -> None:
        self._core = core
        arrays = self._handle.arrays()
        self._fields = MappingProxyType(arrays)
        self._data = arrays[""] if "" in arrays else data.make_data(data.DATA_OF_KIND.get(self.kind, data.SensorData), arrays)

    @property
    def data(self) -> Any:
        """The current measurement of all worlds: an array ``[B, ...]``, or an object with one array per field.

        Computed when it is read, if it is out of date. The arrays are the sensor's own memory and read-only. The next read after
        a step, reset or forward overwrites them, and step() itself may do so. Copy them to keep or change them.
        """
        self._refresh()
        return fresh(self._data)

    def _refresh(self) -> None:
        if self._core is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: make a Simulation of its scene first")
        self._core.refresh(self._handle)

    def _row(self, world: int) -> Any:
        """A copy of the current value of one world."""
        rows = {name: copied(array[world]) for name, array in self.fields.items()}
        return rows.get("", rows)

    @property
    def fields(self) -> Mapping[str, np.ndarray]:
        """All current fields by name; the name of the only or main field is ''."""
        self._refresh()
        return MappingProxyType(fresh(dict(self._fields)))

    @property
    def specs(self) -> dict[str, _core.SensorSpec]:
        """Spec of each field: dtype, shape, unit, frame. The name of a single field is ''."""
        return self._handle.specs()

    @property
    def spec(self) -> _core.SensorSpec:
        """Spec of the only or main field."""
        specs = self.specs
        if "" not in specs:
            raise ValueError(f"sensor '{self.name}' has the fields {sorted(specs)}: use specs")
        return specs[""]

    @property
    def uuid(self) -> str:
        """Its name, as used in suites."""
        return self.name

    @property
    def observation_space(self) -> gymnasium.Space:
        """gymnasium space of one world's value: a Box, or a Dict with one Box per field."""
        spaces: dict[str, gymnasium.Space] = {name: box_of(spec) for name, spec in self.specs.items()}
        return spaces[""] if "" in spaces else gymnasium.spaces.Dict(spaces)

    def debug_shapes(self, world: int = 0) -> DebugShapes:
        """Shapes that visualise the measurement of one world; see :meth:`mjsense.Simulation.draw`."""
        if self._core is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: make a Simulation of its scene first")
        shapes = DebugShapes(world, self._core.meansize)
        shapes._extend(*self._core.draw(world, [self._handle]))
        return shapes

    @property
    def bytes_per_world(self) -> int:
        """Size of one world's row, bytes."""
        return self._handle.bytes_per_world


representations.help_of_objects(NativeSensor)


def box_of(spec: _core.SensorSpec) -> gymnasium.spaces.Box:
    """The space of one world's row of a field."""
    dtype = np.dtype(spec.dtype)
    low, high = spec.low, spec.high
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        low, high = max(low, info.min), min(high, info.max)
    elif dtype.kind == "b":
        low, high = 0, 1
    return gymnasium.spaces.Box(low, high, spec.shape, dtype)


class BuiltinSensor(NativeSensor):
    """One of MuJoCo's own sensors; data is float32 ``[B, dim]``."""

    if TYPE_CHECKING:

        @property
        def data(self) -> NDArray[np.float32]: ...
