# SPDX-License-Identifier: Apache-2.0
"""Sensors over a model and data that the user's own program steps."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.arguments import KnownAttributes, Seed, checked
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.core.mujoco_names import STATE
from mjsense.core.one_thread import OneThread, guarded
from mjsense.scene.randomizable import check_randomizable
from mjsense.scene.scene import Scene
from mjsense.sensors.configs import SceneCfg
from mjsense.sim import foreign_model
from mjsense.sim.simulation import Simulation

_ELEMENTS = (
    ("geom_xpos", "ngeom", "geoms"),
    ("site_xpos", "nsite", "sites"),
    ("cam_xpos", "ncam", "cameras"),
    ("xpos", "nbody", "bodies"),
)
"""Fields of mjData and of the model by which data of a model that was compiled anew is recognised."""
_WRITTEN_STATE = -2
"""Keyframe of a reset to the state as it is."""


@checked
class Attached(KnownAttributes):
    """Sensors over data that the user's program steps; made by :func:`attach`.

    ``attached["front"]`` is the sensor of that name, as ``scene["front"]`` is in a :class:`mjsense.Simulation`; world ``i`` is
    ``data[i]``. The sensors show the states at the last :meth:`update` or :meth:`reset`. The user's model and data are never
    written. A call of :meth:`update`, :meth:`reset`, :meth:`reload` or :meth:`replace` during one of another thread is an error;
    :meth:`close` waits for it.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        sensors: Sequence[Any] = (),
        *,
        decimation: int = 1,
        threads: int = 0,
        seed: Seed = 0,
    ) -> None:
        self._guard = OneThread("attached sensors: another thread is updating them; update them in one thread")
        self.datas: tuple[Any, ...] = tuple(
            getattr(one, "_data", one) for one in (data if isinstance(data, (list, tuple)) else [data])
        )
        """The user's data, by world."""
        if not self.datas:
            raise ValueError("attach(): data is empty: pass one MjData, or a list with one for each world")
        given = model if isinstance(model, (list, tuple)) else [model] * len(self.datas)
        if len(given) != len(self.datas):
            raise ValueError(
                f"attach(): got {counted(len(given), 'model')} for {len(self.datas)} data: pass one model, or one for each data"
            )
        self.models: tuple[Any, ...] = tuple(getattr(one, "_model", one) for one in given)
        """The user's model of each world."""
        packages = [foreign_model.package_of(one) for one in self.models]
        self._mujoco: Any = packages[0]
        self._same_series = foreign_model.is_our_series(self._mujoco)
        first = self.models[0] if self._same_series else foreign_model.copy_of(self.models[0])
        scene = Scene._of_model(SceneCfg(sensors=tuple(sensors)), first._address)
        self._sim = Simulation(scene, len(self.datas), decimation, threads, seed)
        state = self._sim.state
        self._columns: dict[str, slice] = {}
        for name in STATE:
            part = self._sim._component(name)
            start = (_address(part) - _address(state)) // state.itemsize if part.size else 0
            self._columns[name] = slice(start, start + part[0].size)
        for world, one in enumerate(self.datas):
            self._check_data(one, world)
        self._times = np.zeros(len(self.datas))
        self._seen = np.zeros_like(state)
        self._base = foreign_model.values_of(self._sim.model, self._sim.model)
        self._edited = [{}] * len(self.datas)
        self._warned = False
        self._complete = True
        if any(one is not self.models[0] for one in self.models):
            self._read_models("attach()")
        self.reset()

    def _check_data(self, data: Any, world: int, call: str = "attach()") -> None:
        what = f"{call}: data[{world}]"
        if self._mujoco is not None and not isinstance(data, self._mujoco.MjData):
            raise TypeError(f"{what} must be a mujoco.MjData, not {data!r:.100}")
        if any(data is other for i, other in enumerate(self.datas) if i != world):
            raise ValueError(f"{what} is given twice")
        for name, columns in self._columns.items():
            found, expected = np.size(getattr(data, name)), columns.stop - columns.start
            if found != expected:
                raise ValueError(
                    f"{what} belongs to another model: its {name} has {counted(found, 'number')}, and this model's has {expected}"
                )
        for name, size, kind in _ELEMENTS:
            found, expected = len(getattr(data, name)), getattr(self.models[0], size)
            if found != expected:
                raise ValueError(f"{what} belongs to another model: it has {found} {kind}, and this model has {expected}")

    def __repr__(self) -> str:
        if self._sim._core.closed:
            return "<attached sensors, closed>"
        return f"<attached sensors {list(self._sim.scene.sensors)}, {counted(self.num_worlds, 'world')}>"

    def __reduce__(self) -> Any:
        raise TypeError("attached sensors cannot be copied or pickled: attach to the copy of the model and data")

    def __enter__(self) -> Attached:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def close(self) -> None:
        """Frees the sensors once no array of them is referenced any more. Every later call raises RuntimeError."""
        with self._guard.lock:
            self._sim.close()

    def __getitem__(self, name: str) -> Any:
        sensors = self.sensors
        if name in sensors:
            self._warn_if_behind()
            return sensors[name]
        raise UnknownNameError(f"no sensor named '{name}' is attached{did_you_mean(str(name), sensors, 'there are')}")

    def __contains__(self, name: object) -> bool:
        return name in self.sensors

    def __iter__(self) -> Iterator[str]:
        return iter(self.sensors)

    def __len__(self) -> int:
        return len(self.sensors)

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.sensors]

    def _warn_if_behind(self) -> None:
        """Warns once if a sensor is read after a step of a data without update()."""
        for world, before in enumerate(self._times) if not self._warned else ():
            if (now := self.datas[world].time) != before:
                self._warned = True
                warnings.warn(
                    f"attached sensors show data[{world}] at {before:g} s, and it is at {now:g} s: call update() "
                    "after mj_step, or reset() when an "
                    "episode has begun",
                    RuntimeWarning,
                    stacklevel=4,
                )
                return

    @property
    def sensors(self) -> Mapping[str, Any]:
        """The sensors by name: those that were given, then the sensors of the model."""
        return {**self._sim.scene.sensors, **{own.uuid: own for own in self._sim._python}}

    @property
    def num_worlds(self) -> int:
        """Number of worlds, ``B``: one for each data."""
        return self._sim.num_worlds

    @property
    def simulation(self) -> Simulation:
        """The copy of the worlds in which the sensors are computed, for :class:`mjsense.SensorSuite` and drawing. Do not step
        it."""
        return self._sim

    @property
    def time(self) -> np.ndarray:
        """``data.time`` of each world at the last update, s, ``[B]``."""
        return self._times.copy()

    @guarded
    def update(self) -> None:
        """Makes the sensors show the current states of the data.

        Air time, history, delay and everything else that remembers advances by the time by which ``data.time`` has advanced, in
        whole time steps. A sensor with memory sees the states at which this is called: call it after every ``mj_step`` if air
        time must notice contacts of a single step.

        Raises:
            ValueError: If ``data.time`` has run backwards (call :meth:`reset`), or if a state is not finite.
            RuntimeError: If MuJoCo cannot compute a state.
        """
        rows, times = self._rows(range(self.num_worlds))
        timestep = self._sim.physics_dt
        for model in {id(model): model for model in self.models}.values():
            if model.opt.timestep != timestep:
                raise ValueError(
                    f"update(): the model's time step was {timestep:g} s and is now {model.opt.timestep:g} s: attach again"
                )
        moved: dict[int, list[int]] = {}
        for world, (before, now) in enumerate(zip(self._times, times)):
            steps = (now - before) / timestep
            if steps < -1e-6:
                raise ValueError(
                    f"update(): the time of data[{world}] went back from {before:g} s to {now:g} s: call "
                    f"reset([{world}]) when an episode begins"
                )
            # An edited state at the same time has 0 steps. A time between two steps counts as the next one.
            count = max(round(steps), int(steps > 1e-6))
            if count or not np.array_equal(rows[world], self._seen[world]):
                moved.setdefault(count, []).append(world)
        self._write(range(self.num_worlds), rows, times)
        for count, ids in moved.items():
            if count:
                self._sim._core.follow(count, ids)
            else:
                self._sim._core.forward(ids)
            self._check_failures("update")

    @guarded
    def reset(self, ids: Sequence[int] | None = None) -> None:
        """Call when an episode has begun in these worlds: clears what sensors remember, and shows the current states.

        Args:
            ids: Worlds, or a mask; by default all.
        """
        worlds = self._worlds(ids)
        rows, times = self._rows(worlds)
        self._write(worlds, rows, times)
        self._sim._core.reset(worlds, _WRITTEN_STATE, None)
        self._check_failures("reset")

    @guarded
    def reload(self) -> None:
        """Call after the model was edited (masses, sizes, friction, colours, options ...): the sensors follow.

        Raises:
            ValueError: If a change cannot be followed, which then needs a new :func:`attach`: meshes, height fields, textures,
                the time step, and the structure of the model.
        """
        self._read_models("reload()")
        self._sim.forward()

    @guarded
    def replace(self, world: int, data: Any, model: Any = None) -> None:
        """Call when the program has made a new data for a world, and perhaps a new model; an episode begins in it.

        Args:
            world: Id of the world.
            data: The new ``mujoco.MjData``.
            model: The world's new model, of the same structure; its values are read as by :meth:`reload`.

        Raises:
            ValueError: If the new model or data has another structure; it needs a new :func:`attach`.
        """
        (world,) = self._worlds([world])
        data = getattr(data, "_data", data)
        self._check_data(data, world, "replace()")
        self.datas = (*self.datas[:world], data, *self.datas[world + 1 :])
        if model is not None:
            self.models = (*self.models[:world], getattr(model, "_model", model), *self.models[world + 1 :])
            self._read_models("replace()")
        self.reset([world])

    def add(self, sensor: Any) -> Any:
        """Adds a sensor that needs no element in the model: a user-defined one, or one such as
        :class:`mjsense.sensors.PoseSensor`. Returns it."""
        return self._sim.add(sensor)

    # ---------------------------------------------------------------------------------------------------------- states

    _seen: np.ndarray
    _edited: list[dict[str, np.ndarray]]
    """By world: the values of its model that differ from those of the first model at the start, or did so at the last reading."""

    def _read_models(self, call: str) -> None:
        """Copies the values in which the models differ from what the worlds have."""
        groups: dict[tuple[int, int], list[int]] = {}
        for world, model in enumerate(self.models):
            groups.setdefault((id(model), id(self._edited[world])), []).append(world)
        edited, writes = [*self._edited], []
        for worlds in groups.values():
            values, rows = self._changes(
                self.models[worlds[0]], self._edited[worlds[0]], f"{call}: {{}} of the model of data[{worlds[0]}]"
            )
            writes += [(target, worlds, new) for target, new in rows]
            for world in worlds:
                edited[world] = values
        for target, worlds, new in writes:
            target[worlds, : len(new)] = new
        self._edited = edited
        if writes:
            self._sim._core.model_changed(None, False)
            self._sim._models.follow()

    def _changes(
        self, model: Any, known: dict[str, np.ndarray], what: str
    ) -> tuple[dict[str, np.ndarray], list[tuple[np.ndarray, np.ndarray]]]:
        """Returns the new `known`, and the rows of all worlds with the bytes to write. Raises ValueError for changes that cannot
        be written."""
        sim = self._sim
        values, rows = dict(known), []
        copy = model if self._same_series else foreign_model.copy_of(model)
        try:
            _core.check_model_indices(copy._address)
        except ValueError as error:
            raise ValueError(str(error).replace("the model's ", what.split("{}")[0], 1)) from None
        for name, now in foreign_model.values_of(copy, sim.model).items():
            old = known[name] if name in known else self._base[name][: len(now)]
            if now.shape != old.shape:
                raise ValueError(
                    f"{what.format(name)} has the shape {now.shape} instead of {old.shape}: it needs its own attach()"
                )
            if np.array_equal(now, old, equal_nan=now.dtype.kind == "f"):
                continue
            try:
                if name != "bvh_aabb":
                    check_randomizable(sim.model, name)
                target = sim._core.model_field(name)  # bytes
            except ValueError as error:
                raise ValueError(f"{what.format(name)} is different, which only a new attach() follows ({error})") from None
            size = min(target.shape[1], now.nbytes)  # of bvh_aabb, worlds have the boxes of bodies, but not those of meshes
            if name == "opt.timestep" or not np.array_equal(_bytes(now)[size:], _bytes(old)[size:]):
                raise ValueError(f"{what.format(name)} is different, which only a new attach() follows")
            values[name] = np.array(now)
            rows.append((target, _bytes(values[name])[:size]))
        return values, rows

    def _worlds(self, ids: Sequence[int] | None) -> list[int]:
        found = self._sim._ids(ids)
        return list(range(self.num_worlds)) if found is None else found

    def _rows(self, worlds: Sequence[int]) -> tuple[np.ndarray, list[float]]:
        """The states of these data in the layout of ``simulation.state``, and their times. Raises ValueError if one is not
        finite."""
        rows = np.array(self._sim.state[list(worlds)])
        for row, world in zip(rows, worlds):
            data = self.datas[world]
            if self._same_series and self._mujoco is not None:
                self._mujoco.mj_getState(self.models[world], data, row, self._mujoco.mjtState.mjSTATE_INTEGRATION)
            else:
                for name, columns in self._columns.items():
                    row[columns] = np.ravel(getattr(data, name))
            if not np.isfinite(row).all():
                self._refuse(row, world)
        return rows, [self.datas[world].time for world in worlds]

    def _refuse(self, row: np.ndarray, world: int) -> None:
        for name, columns in self._columns.items():
            bad = np.flatnonzero(~np.isfinite(row[columns]))
            if len(bad):
                raise ValueError(f"the state of data[{world}] is not finite: {name}, number {bad[0]}, is {row[columns][bad[0]]}")
        raise ValueError(f"the state of data[{world}] is not finite: a history or the state of a plugin")

    def _write(self, worlds: Sequence[int], rows: np.ndarray, times: Sequence[float]) -> None:
        self._sim.state[list(worlds)] = rows
        self._seen[list(worlds)] = rows
        self._times[list(worlds)] = times

    def _check_failures(self, call: str) -> None:
        for world, message in self._sim.failures:
            raise RuntimeError(f"{call}(): MuJoCo cannot compute the state of data[{world}]: {message}")


@checked
def attach(
    model: Any, data: Any, sensors: Sequence[Any] = (), *, decimation: int = 1, threads: int = 0, seed: Seed = 0
) -> Attached:
    """Attaches sensors to a model and data that the user's own program steps::

        attached = mjsense.attach(model, data, sensors=(mjs.CameraSensorCfg(name="front", camera_name="front"),))
        while True:
            mujoco.mj_step(model, data)
            attached.update()
            attached["front"].data.rgb      # uint8 [1, H, W, 3]

    Sensors show the states at the last update. The first ``attached["front"]`` after a step without an update warns.

    Works with every MuJoCo from 3.3 on. Each update copies the state and computes from it what sensors read, so that measurements
    belong to the current state, unlike the fields of an MjData after ``mj_step``, which are one step behind.

    Args:
        model: The ``mujoco.MjModel``, or robosuite's or dm_control's wrapper of it, or a list with one of the same structure for
            each world. It is not changed.
        data: A ``mujoco.MjData`` of the model, or a list with one for each world.
        sensors: Sensor configurations and :class:`mjsense.Sensor` objects, as in :class:`mjsense.SceneCfg`. Names are those of
            the model; an element without a name has the name of its kind and number, ``geom_3``. MuJoCo's sensors of the model
            are attached, too.
        decimation: Number of ``mj_step`` calls between two updates: the control period of sensors that have one.
        threads: Number of threads; 0: one per CPU that is available to this process.
        seed: Seed of the random numbers (noise, delays).

    Raises:
        TypeError: If ``model`` or ``data`` is not one of MuJoCo's.
        ValueError: If a data belongs to another model, or a sensor needs an element that the model lacks; the message says what
            to add.
    """
    return Attached(model, data, sensors, decimation=decimation, threads=threads, seed=seed)


def _bytes(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8)


def _address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]
