# SPDX-License-Identifier: Apache-2.0
"""Sensors as Python sees them: those computed in C++, and the base class of your own."""

from __future__ import annotations

import inspect
import json
import weakref
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from mjsense import _core, data
from mjsense._arguments import KnownAttributes, checked
from mjsense.drawing import DebugShapes

if TYPE_CHECKING:
    import mujoco

    from mjsense.simulation import Simulation


def encode_json(value: Any) -> bytes:
    """JSON text as it stands in files: sorted keys, no blanks, ASCII; NumPy values as Python numbers and lists."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=_plain).encode("ascii")


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no JSON value")


@checked
class NativeSensor(KnownAttributes):
    """A sensor of the scene that C++ computes."""

    def __init__(self, handle: _core.SensorHandle) -> None:
        self._handle = handle
        self._core: _core.Simulation | None = None
        self._data: Any = None
        self._fields: Mapping[str, np.ndarray] = {}
        self.name: str = handle.name
        """Key in the scene."""
        self.kind: str = handle.kind
        """builtin, contact, raycast, camera ..."""
        self.cfg: Any = None
        """Its configuration; None for a sensor that was found in the model."""
        self._complete = True

    def __repr__(self) -> str:
        return f"<{self.kind} sensor '{self.name}'>"

    def _bind(self, core: _core.Simulation) -> None:
        self._core = core
        arrays = self._handle.arrays()
        self._fields = MappingProxyType(arrays)
        self._data = arrays[""] if "" in arrays else data.make_data(data.DATA_OF_KIND.get(self.kind, data.SensorData), arrays)

    @property
    def data(self) -> Any:
        """The measurement of every world as it is now: an array ``[B, ...]``, or an object with one array a field.

        Computed when it is read and not current. The arrays are the sensor's own memory, read-only: the next read after a step,
        reset or forward overwrites them. Copy what you keep, or change.
        """
        if self._core is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: make a Simulation of its scene first")
        self._core.refresh(self._handle)
        return self._data

    @property
    def fields(self) -> Mapping[str, np.ndarray]:
        """Every field as it is now, by name; the only or main one is ''."""
        self.data  # makes them current
        return self._fields

    @property
    def specs(self) -> dict[str, _core.SensorSpec]:
        """What each field is: dtype, shape, unit, frame. A sensor with one field calls it ''."""
        return self._handle.specs()

    @property
    def spec(self) -> _core.SensorSpec:
        """The spec of a sensor with one field, or of its main one."""
        specs = self.specs
        if "" not in specs:
            raise ValueError(f"sensor '{self.name}' has the fields {sorted(specs)}: use specs")
        return specs[""]

    @property
    def uuid(self) -> str:
        """Its name, as suites call it."""
        return self.name

    @property
    def observation_space(self) -> gymnasium.Space:
        """gymnasium space of one world's value: a Box, or a Dict of one Box a field."""
        spaces: dict[str, gymnasium.Space] = {name: _box(spec) for name, spec in self.specs.items()}
        return spaces[""] if "" in spaces else gymnasium.spaces.Dict(spaces)

    def debug_shapes(self, world: int = 0) -> DebugShapes:
        """What it measures in this world, as shapes to look at: see :meth:`mjsense.Simulation.draw`."""
        if self._core is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: make a Simulation of its scene first")
        shapes = DebugShapes(world, self._core.meansize)
        shapes._extend(*self._core.draw(world, [self._handle]))
        return shapes

    @property
    def bytes_per_world(self) -> int:
        """Memory of one world's row."""
        return self._handle.bytes_per_world


def _box(spec: _core.SensorSpec) -> gymnasium.spaces.Box:
    dtype = np.dtype(spec.dtype)
    low, high = spec.low, spec.high
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        low, high = max(low, info.min), min(high, info.max)
    elif dtype.kind == "b":
        low, high = 0, 1
    return gymnasium.spaces.Box(low, high, spec.shape, dtype)


class Sensor:
    """Base class of sensors written in Python. Write one of these methods, whichever suits:

    - ``compute(sim)`` returns the rows of all worlds, an array ``[B, ...]``;
    - ``_compute_data()`` the same, without an argument (as in mjlab);
    - ``get_observation(env, task, batch_index=0)`` returns the row of one world (as in MolmoSpaces).

    The value is computed when it is read and not current, once for all. With an ``observation_space`` the rows are kept in one
    array of its dtype and shape, which suites and recordings read; without one ``data`` is whatever you return.
    """

    uuid: str = ""
    """Name in scenes, suites and files."""
    observation_space: Any = None
    """gymnasium space of one world's row: Box, Discrete, MultiBinary or MultiDiscrete."""
    is_dict: bool = False
    """The value of a world is a dict, kept as JSON text of at most ``str_max_len`` bytes."""
    str_max_len: int = 2000
    unit: str = ""
    frame: str = ""

    # Names of ours begin so, that yours are free.
    _mjs_handle: Any = None
    _mjs_core: Any = None
    _mjs_sim_ref: Any = None
    _mjs_scene_ref: Any = None
    _mjs_value: Any = None
    _mjs_rows: Any = None
    _mjs_shown: Any = None
    _mjs_pending_dt: float = 0.0

    def __init__(self, uuid: str | None = None, observation_space: Any = None) -> None:
        if uuid is not None:
            self.uuid = uuid
        if observation_space is not None:
            self.observation_space = observation_space

    def __repr__(self) -> str:
        return f"<{type(self).__name__} '{self.uuid}'>"

    # ------------------------------------------------------------------------------------------------- yours to write

    def edit_spec(self, spec: mujoco.MjSpec) -> None:
        """Adds MuJoCo elements before compilation."""

    def initialize(self, sim: Simulation) -> None:
        """Called once the model is compiled: resolve names, allocate."""

    def compute(self, sim: Simulation) -> Any:
        """Rows of all worlds, ``[B, ...]``."""
        if _overrides(self, "_compute_data"):
            value = self._compute_data()
            if value is None:
                raise ValueError("_compute_data() returned None")
            return value
        if _overrides(self, "get_observation"):
            return [self.get_observation(sim, None, w) for w in range(sim.num_worlds)]
        raise NotImplementedError("write compute(sim), _compute_data() or get_observation(env, task, batch_index)")

    def _compute_data(self) -> Any:
        raise NotImplementedError

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        """Row of one world."""
        return self.data[batch_index]

    def update(self, dt: float) -> None:
        """Called after every control step with its length (s), before the value of that step is computed."""

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """These worlds (None: all) begin a new episode."""

    def debug_vis(self, visualizer: DebugShapes) -> None:
        """Shows world ``visualizer.env_idx`` to a human: ``visualizer.add_arrow(start, end, color)`` and so on."""

    # --------------------------------------------------------------------------------------------------------- reading

    @property
    def name(self) -> str:
        """The same as uuid, as mjlab calls it."""
        return self.uuid

    @name.setter
    def name(self, name: str) -> None:
        self.uuid = name

    @property
    def simulation(self) -> Simulation:
        """The simulation it belongs to."""
        sim = self._mjs_sim_ref() if self._mjs_sim_ref else None
        if sim is None:
            raise RuntimeError(f"sensor '{self.uuid}' belongs to no simulation yet")
        return sim

    @property
    def data(self) -> Any:
        """The present value, of all worlds."""
        if self._mjs_core is None:
            raise RuntimeError(f"sensor '{self.uuid}' has no data yet: it belongs to no simulation")
        self._mjs_core.refresh(self._mjs_handle)
        return self._mjs_value

    @property
    def rows(self) -> np.ndarray:
        """What a recording stores: ``[B, ...]``, for is_dict sensors JSON text in uint8 ``[B, str_max_len]``."""
        if self._mjs_rows is None:
            raise RuntimeError(f"sensor '{self.uuid}' has no rows: give it an observation_space, or is_dict = True")
        self._mjs_core.refresh(self._mjs_handle)
        return self._mjs_shown

    def debug_shapes(self, world: int = 0) -> DebugShapes:
        """What ``debug_vis`` shows of this world."""
        return self.simulation.debug_shapes(world, self)

    # ------------------------------------------------------------------------------- called by mjsense (the C++ adapter)

    def _mjs_edit_spec(self) -> None:
        scene = self._mjs_scene_ref() if self._mjs_scene_ref else None
        if scene is not None:
            self._mjs_call("edit_spec", scene.spec, scene)

    def _mjs_bind(self, sim: Simulation, handle: _core.SensorHandle) -> None:
        self._mjs_sim_ref, self._mjs_handle, self._mjs_core = weakref.ref(sim), handle, sim._core
        self._mjs_rows = handle.arrays(writable=True).get("")
        self._mjs_shown = handle.arrays().get("")
        if not self.is_dict:
            self._mjs_value = self._mjs_shown
        self._mjs_call("initialize", sim, sim)

    def _mjs_call(self, method: str, first: Any, owner: Any) -> None:
        """Calls edit_spec or initialize with our arguments or, where it takes more, with mjlab's."""
        function = getattr(self, method)
        wanted = len([p for p in inspect.signature(function).parameters.values() if p.default is p.empty and p.kind < 2])
        with _named(self, method):
            if method == "edit_spec" and wanted == 2:
                function(first, owner._entities_of_spec())
            elif method == "initialize" and wanted == 4:
                function(owner.model, owner.model, owner.data, "cpu")
            else:
                function(first)

    def _mjs_reset(self, world_ids: list[int]) -> None:
        with _named(self, "reset"):
            if not inspect.signature(self.reset).parameters:
                self.reset()
            else:
                self.reset(None if len(world_ids) == self.simulation.num_worlds else world_ids)

    def _mjs_draw(self, shapes: DebugShapes) -> None:
        if not _overrides(self, "debug_vis"):
            raise ValueError(f"sensor '{self.uuid}' has nothing to draw: write debug_vis(visualizer)")
        with _named(self, "debug_vis"):
            self.debug_vis(shapes)

    def _mjs_update_pending(self) -> None:
        if self._mjs_pending_dt:
            dt, self._mjs_pending_dt = self._mjs_pending_dt, 0.0
            with _named(self, "update"):
                self.update(dt)

    def _mjs_compute_rows(self) -> None:
        if self._mjs_sim_ref is None:
            return  # the simulation is being made; initialize() has not been called
        self._mjs_update_pending()
        sim = self.simulation
        with _named(self, "compute"):
            value = self.compute(sim)
            if self._mjs_rows is None:
                self._mjs_value = value
            elif self.is_dict:
                self._mjs_value = list(value)
                self._mjs_write_json(self._mjs_value, sim.num_worlds)
            else:
                self._mjs_write_rows(value)

    def _mjs_write_rows(self, value: Any) -> None:
        rows = self._mjs_rows
        array = np.asarray(value)
        if array.shape != rows.shape:
            raise ValueError(f"shape {array.shape} is not {rows.shape}: B worlds, then the observation_space")
        if not np.can_cast(array.dtype, rows.dtype, casting="same_kind"):
            raise ValueError(f"{array.dtype} values do not fit the observation_space's {rows.dtype}")
        rows[...] = array

    def _mjs_write_json(self, values: list[Any], num_worlds: int) -> None:
        if len(values) != num_worlds:
            raise ValueError(f"{len(values)} values for {num_worlds} worlds")
        for world, value in enumerate(values):
            text = encode_json(value)
            if len(text) > self.str_max_len:
                raise ValueError(f"world {world}: JSON text of {len(text)} bytes, str_max_len is {self.str_max_len}")
            self._mjs_rows[world] = 0
            self._mjs_rows[world, : len(text)] = np.frombuffer(text, np.uint8)

    def _mjs_row_spec(self) -> dict[str, Any] | None:
        if not self.uuid:
            raise ValueError(f"{type(self).__name__} has no uuid")
        common = {"unit": self.unit, "frame": self.frame, "description": (type(self).__doc__ or "").strip().split("\n")[0]}
        if self.is_dict:
            return {"dtype": "uint8", "shape": [self.str_max_len], "is_dict": True, "low": 0, "high": 255, **common}
        space = self.observation_space
        if space is None or getattr(space, "shape", None) is None or getattr(space, "dtype", None) is None:
            return None
        dtype = np.dtype(space.dtype).name
        return {
            "dtype": {"int8": "int32", "int16": "int32", "float16": "float32"}.get(dtype, dtype),
            "shape": list(space.shape),
            "is_dict": False,
            "low": float(np.min(getattr(space, "low", -np.inf))),
            "high": float(np.max(getattr(space, "high", np.inf))),
            **common,
        }


def _overrides(sensor: Sensor, method: str) -> bool:
    return getattr(type(sensor), method) is not getattr(Sensor, method)


class _named:
    """Errors of user code say which sensor and which of its methods failed; the traceback stays."""

    def __init__(self, sensor: Sensor, method: str) -> None:
        self.place = f"sensor '{sensor.uuid}': {method}()"

    def __enter__(self) -> None: ...

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        if isinstance(error, Exception):
            raise SensorError(f"{self.place}: {kind.__name__}: {error}") from error


class SensorError(RuntimeError):
    """Code of a sensor written in Python failed; ``__cause__`` is its exception."""


class BuiltinSensor(NativeSensor):
    """One of MuJoCo's own sensors; data is float32 ``[B, dim]``."""
