# SPDX-License-Identifier: Apache-2.0
"""Base class of user-defined sensors."""

from __future__ import annotations

import copy
import json
import weakref
from collections.abc import Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import gymnasium
import numpy as np

from mjsense import _core
from mjsense.core import representations
from mjsense.core.arrays import fresh
from mjsense.core.counted import counted
from mjsense.sensors.calls import Calls, EachWorld, Values, calls_of
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.row_declarations import Row, leaves, nested, rows_of_space, rows_of_value
from mjsense.sensors.user_code import SensorError, named

if TYPE_CHECKING:
    import mujoco


T = TypeVar("T")


def encode_json(value: Any) -> bytes:
    """JSON text as stored in files: sorted keys, no blanks, ASCII; NumPy values as Python numbers and lists."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=_plain).encode("ascii")


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be converted to JSON")


class Sensor(Generic[T]):
    """Base class of sensors written in Python; ``T`` in ``Sensor[T]`` is the type of ``data``.

    ``compute(sim)`` returns the values of all worlds, ``[B, ...]``; ``compute(sim, world_ids)`` returns those of the given
    worlds, in order. One instance serves all worlds and stores its state per world.

    Classes with the methods of other libraries work too, if they have no ``compute``:

    - ``_compute_data()`` equals ``compute(sim)`` without an argument (as in mjlab);
    - ``get_observation(env, task, batch_index=0)`` returns the value of one world (as in MolmoSpaces). `env` is
      :attr:`mjsense.Simulation.env`; `task` is None except in recordings and environments. There is one instance per world: the
      given object belongs to world 0, and the others are deep copies that are created when the sensor is added to its simulation.
      Its ``reset()`` has no arguments. (A ``reset(world_ids)`` makes one instance serve all worlds here too.)

    The value is computed once per state, when it is read. With an ``observation_space``, rows are stored in arrays of its dtype
    and shape, from which suites and recordings read. A value with another dtype or shape, or outside the bounds, is an error;
    Python numbers and lists are converted to the declared dtype. A ``gymnasium.spaces.Dict`` describes a nested dict of arrays;
    if it is empty, the arrays are those of the first value. Without a space, ``data`` is whatever the method returns.
    """

    uuid: str = ""
    """Name in scenes, suites and files."""
    observation_space: Any = None
    """gymnasium space of one world's value: Box, Discrete, MultiBinary, MultiDiscrete, or a Dict of these."""
    is_dict: bool = False
    """True if the value of a world is a dict, which is stored as JSON text of at most ``str_max_len`` bytes."""
    str_max_len: int = 2000
    unit: str = ""
    frame: str = ""

    # Private names start with _mjs_, so that subclasses can use all others.
    _mjs_handle: Any = None
    _mjs_core: Any = None
    _mjs_sim_ref: Any = None
    _mjs_scene_ref: Any = None
    _mjs_value: Any = None
    _mjs_fields: list[Row] | None = None  # None until declared; [] if the value is a Python object without rows
    _mjs_rows: Any = None  # a list with the array of each field; None without fields
    _mjs_shown: Any = None
    _mjs_adapter: Calls | None = None  # see _mjs_calls
    _mjs_stateless: bool = False  # True: one instance serves all worlds whatever its methods are
    _mjs_worked: bool = False  # True after the first valid row

    def __init__(self, uuid: str | None = None, observation_space: Any = None, **kwargs: Any) -> None:
        if uuid is not None:
            self.uuid = uuid
        if observation_space is not None:
            self.observation_space = observation_space

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        representations.help_of_objects(cls)

    def _help(self) -> str:
        return representations.help_text(type(self), self._mjs_about())

    def __repr__(self) -> str:
        return representations.line(f"{type(self).__name__} '{self.uuid}'", self._mjs_about())

    def _repr_html_(self) -> str:
        """HTML for notebooks: its fields, and a thumbnail if its row is an image."""
        live = isinstance(self._mjs_shown, np.ndarray) and not self._mjs_core.closed
        images = {self.uuid: self.rows[0]} if live and self._mjs_shown.ndim == 4 else {}
        return representations.table(f"{type(self).__name__} '{self.uuid}'", self._mjs_about(), images)

    def _mjs_about(self) -> list[representations.Row]:
        worlds = [len(self._mjs_rows[0])] if self._mjs_rows else []
        return [
            representations.Row(
                spec["name"], spec["dtype"], (*worlds, *spec["shape"]), self.unit, self.frame, spec["description"]
            )
            for spec in (self._mjs_row_specs() if self.uuid else [])
        ]

    # -------------------------------------------------------------------------------------------- to be implemented or overridden

    def edit_spec(self, spec: mujoco.MjSpec) -> None:
        """Adds MuJoCo elements to the model before compilation."""

    def initialize(self, sim: Any) -> None:
        """Called once after compilation, with the :class:`mjsense.Simulation`: resolve names and allocate memory here."""

    def compute(self, sim: Any) -> Any:
        """Returns the values of all worlds, ``[B, ...]``. May be called several times per step (if a world was reset): change
        state only in update()."""
        raise NotImplementedError("write compute(sim), _compute_data() or get_observation(env, task, batch_index)")

    def update(self, dt: float) -> None:
        """Called after every control step of ``dt`` seconds, before the value of that step is computed."""

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """Called when a new episode starts in these worlds (None: all)."""

    def debug_vis(self, visualizer: DebugShapes) -> None:
        """Visualises the measurement of world ``visualizer.env_idx``: ``visualizer.add_arrow(start, end, color)`` and so on."""

    # --------------------------------------------------------------------------------------------------------- reading

    @property
    def name(self) -> str:
        """The same as ``uuid``; the name that mjlab uses."""
        return self.uuid

    @name.setter
    def name(self, name: str) -> None:
        self.uuid = name

    @property
    def simulation(self) -> Any:
        """The :class:`mjsense.Simulation` that it belongs to; raises RuntimeError if there is none."""
        sim = self._mjs_sim_ref() if self._mjs_sim_ref else None
        if sim is None:
            raise RuntimeError(f"sensor '{self.uuid}' belongs to no simulation yet")
        return sim

    @property
    def data(self) -> T:
        """The current value of all worlds: an array ``[B, ...]``, a nested dict of arrays, or a list of dicts by world."""
        if self._mjs_core is None:
            raise RuntimeError(f"sensor '{self.uuid}' has no data yet: it belongs to no simulation")
        self._mjs_core.refresh(self._mjs_handle)
        return fresh(self._mjs_value) if self._mjs_fields else self._mjs_value

    @property
    def rows(self) -> Any:
        """Rows as they are recorded: ``[B, ...]`` or a nested dict of such arrays; JSON text in uint8 ``[B, str_max_len]`` for
        is_dict sensors."""
        if self._mjs_rows is None:
            raise RuntimeError(f"sensor '{self.uuid}' has no rows: give it an observation_space, or is_dict = True")
        self._mjs_core.refresh(self._mjs_handle)
        return fresh(self._mjs_shown)

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        """The current value of one world, as sensors of MolmoSpaces give it."""
        return self._mjs_row(batch_index)

    def debug_shapes(self, world: int = 0) -> DebugShapes:
        """The shapes that ``debug_vis`` adds for this world."""
        return self.simulation.debug_shapes(world, self)

    # ----------------------------------------------------------------------------------------- called by mjsense: its life

    def _mjs_original(self) -> Any:
        """The object whose methods are called."""
        return self

    @property
    def _mjs_calls(self) -> Calls:
        """Calls its methods."""
        if self._mjs_adapter is None or self._mjs_adapter.sensor is not self:  # a copy makes its own
            self._mjs_adapter = self._mjs_make_calls()
        return self._mjs_adapter

    def _mjs_make_calls(self) -> Calls:
        return calls_of(self)

    def _mjs_edit_spec(self) -> None:
        scene = self._mjs_scene_ref() if self._mjs_scene_ref else None
        if scene is not None:
            self._mjs_calls.edit_spec(scene)

    def _mjs_bind(self, sim: Any, handle: _core.SensorHandle) -> None:
        self._mjs_calls.prepare(sim)
        self._mjs_sim_ref, self._mjs_handle, self._mjs_core = weakref.ref(sim), handle, sim._core
        self._mjs_worked = False
        if self._mjs_fields:
            written, shown = handle.arrays(writable=True), handle.arrays()
            self._mjs_rows = [written[row.name] for row in self._mjs_fields]
            self._mjs_shown = nested(self._mjs_fields, [shown[row.name] for row in self._mjs_fields])
        self._mjs_value = self._mjs_shown
        if self.is_dict or (self._mjs_calls.by_world and not self._mjs_fields):
            self._mjs_value = [None] * sim.num_worlds
        self._mjs_calls.initialize(sim)

    def _mjs_reset(self, world_ids: list[int], seeds: Sequence[int] = ()) -> None:
        self._mjs_calls.reset(world_ids, self.simulation.num_worlds, seeds)

    def _mjs_draw(self, shapes: DebugShapes) -> None:
        if not self._mjs_overrides("debug_vis"):
            raise ValueError(f"sensor '{self.uuid}' has nothing to draw: write debug_vis(visualizer)")
        self._mjs_calls.draw(shapes)

    def _mjs_updates(self) -> bool:
        """Whether it must be called after every control step."""
        return self._mjs_overrides("update")

    def _mjs_control_step(self, world_ids: list[int], dt: float, seeds: Sequence[int] = ()) -> list[tuple[int, SensorError]]:
        return [] if self._mjs_sim_ref is None else self._mjs_calls.update(self.simulation, world_ids, dt, seeds)

    def _mjs_overrides(self, method: str) -> bool:
        """Whether its class has its own method of this name."""
        return getattr(type(self), method) is not getattr(Sensor, method)

    # ---------------------------------------------------------------------------------------- called by mjsense: its values

    def _mjs_compute_rows(self, world_ids: list[int], seeds: Sequence[int] = ()) -> list[tuple[int, SensorError]]:
        """Computes the rows of these worlds and returns (world, error) of those that failed. Raises if all failed and none ever
        succeeded."""
        if self._mjs_sim_ref is None:
            return []  # the simulation is under construction and initialize() has not been called
        computed = self._mjs_calls.compute(self.simulation, world_ids, seeds)
        faults = self._mjs_put_each(computed) if isinstance(computed, EachWorld) else self._mjs_put_all(world_ids, computed)
        if len(faults) < len(world_ids):
            self._mjs_worked = True
        elif not self._mjs_worked and faults:
            raise faults[0][1]  # it has never worked, so the fault is not limited to single episodes
        return faults

    def _mjs_put_each(self, computed: EachWorld) -> list[tuple[int, SensorError]]:
        faults = []
        with closing(computed.values) as values:
            for world, value in values:
                try:
                    if isinstance(value, SensorError):
                        raise value
                    with named(self.uuid, computed.method, world):
                        self._mjs_put(world, value)
                except SensorError as error:
                    faults.append((world, error))
        return faults

    def _mjs_put(self, world: int, value: Any) -> None:
        """Stores the value of one world."""
        if not self._mjs_fields:
            self._mjs_value[world] = value
        elif self.is_dict:
            self._mjs_write_json(world, value)
        else:
            arrays = [row.array(leaf) for row, leaf in zip(self._mjs_fields, leaves(value, self._mjs_fields))]
            for row, array in zip(self._mjs_fields, arrays):
                for _, text in row.outside(array[None]):
                    raise ValueError(text)
            for rows, array in zip(self._mjs_rows, arrays):
                rows[world] = array

    def _mjs_put_all(self, world_ids: list[int], computed: Values) -> list[tuple[int, SensorError]]:
        value, of = computed
        with named(self.uuid, "compute"):
            if self.is_dict:
                return self._mjs_put_dicts(world_ids, of, list(value))
            if not self._mjs_fields:
                self._mjs_value = value
                return []
            values = leaves(value, self._mjs_fields)
            arrays = [row.array(leaf, len(of)) for row, leaf in zip(self._mjs_fields, values)]
        picked = [of.index(world) for world in world_ids] if len(of) != len(world_ids) else slice(None)
        faults: dict[int, SensorError] = {}
        for row, rows, array in zip(self._mjs_fields, self._mjs_rows, arrays):
            rows[world_ids] = array[picked]
            for i, text in row.outside(array[picked]):
                faults.setdefault(world_ids[i], SensorError(f"sensor '{self.uuid}', world {world_ids[i]}: compute(): {text}"))
        return sorted(faults.items())

    def _mjs_put_dicts(self, world_ids: list[int], of: list[int], values: list[Any]) -> list[tuple[int, SensorError]]:
        if len(values) != len(of):
            raise ValueError(f"{counted(len(values), 'value')} for {counted(len(of), 'world')}")
        faults = []
        for world in world_ids:
            try:
                with named(self.uuid, "compute", world):
                    self._mjs_write_json(world, values[of.index(world)])
            except SensorError as error:
                faults.append((world, error))
        return faults

    def _mjs_write_json(self, world: int, value: Any) -> None:
        text = encode_json(value)
        if len(text) > self.str_max_len:
            raise ValueError(f"JSON text of {len(text)} bytes, str_max_len is {self.str_max_len}")
        row = self._mjs_rows[0][world]
        row[:] = 0
        row[: len(text)] = np.frombuffer(text, np.uint8)
        self._mjs_value[world] = value

    def _mjs_row(self, world: int) -> Any:
        """A copy of the current value of one world."""
        value: Any = self.data
        if self._mjs_fields and not self.is_dict:
            return nested(self._mjs_fields, [np.array(array[world]) for array in leaves(value, self._mjs_fields)])
        return copy.copy(value[world])

    def _mjs_probe(self, sim: Any) -> None:
        """Determines the arrays that the space leaves open from the value of a copied sensor in world 0."""
        space = self.observation_space
        if self.is_dict or not isinstance(space, gymnasium.spaces.Dict) or space.spaces:
            return
        try:
            value = self._mjs_calls.probe(sim)
        except SensorError:
            raise
        except Exception as error:
            raise SensorError(
                f"sensor '{self.uuid}': its observation_space names no arrays, and it has no value yet to find them in "
                f"({type(error).__name__}: {error}): declare a Dict of Boxes"
            ) from error
        if value is not None:
            self._mjs_fields = rows_of_value(value)

    def _mjs_declared(self) -> list[Row]:
        if self.is_dict:
            return [Row((), (int(self.str_max_len),), np.dtype(np.uint8))]
        if self._mjs_fields is not None and self._mjs_fields[:1] and not rows_of_space(self.observation_space):
            return self._mjs_fields  # determined by _mjs_probe()
        try:
            return rows_of_space(self.observation_space)
        except TypeError as error:
            raise TypeError(f"sensor '{self.uuid}': {error}") from None

    def _mjs_row_specs(self) -> list[dict[str, Any]]:
        """Specs of the rows for C++."""
        if not self.uuid:
            raise ValueError(f"{type(self).__name__} has no uuid")
        for name in ("uuid", "unit", "frame"):
            if not isinstance(value := getattr(self, name), str):
                raise TypeError(f"{type(self).__name__}.{name} must be a str, not {value!r}")
        self._mjs_fields = self._mjs_declared()
        description = (type(self._mjs_original()).__doc__ or "").strip().split("\n")[0]
        specs = []
        for row in self._mjs_fields:
            low, high = (0.0, 255.0) if self.is_dict else row.bounds()
            try:
                kept = row.kept
            except ValueError as error:
                raise ValueError(f"sensor '{self.uuid}': {error}") from None
            specs.append(
                {
                    "name": row.name,
                    "dtype": kept,
                    "shape": list(row.shape),
                    "low": low,
                    "high": high,
                    "is_dict": self.is_dict,
                    "unit": self.unit,
                    "frame": self.frame,
                    "description": description,
                }
            )
        return specs
