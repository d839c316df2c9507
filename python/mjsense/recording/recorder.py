# SPDX-License-Identifier: Apache-2.0
"""The recorder for user-defined loops."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mjsense import _core
from mjsense.core.arguments import KnownAttributes, Seed, checked
from mjsense.core.arrays import ids_of_worlds
from mjsense.core.declared_fields import given_options
from mjsense.core.old_names import old_order
from mjsense.sensors.given_sensor import as_sensor
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.suite import SensorSuite, add_missing
from mjsense.sim.simulation import Simulation

if TYPE_CHECKING:
    from fractions import Fraction


class WarpSimulation(Protocol):
    """The part of :class:`mjsense.warp.simulation.WarpSimulation` that a recorder reads."""

    scene: Any
    num_worlds: int
    step_dt: float
    _core: Any

    def refresh(self, sensors: Sequence[Any]) -> None: ...
    def _host_rows(self, sensors: Sequence[Any]) -> Any: ...


@old_order(
    "Recorder(out, simulation, ...)",
    "Recorder(simulation, out, ...)",
    ("out", "simulation", "sensors"),
    lambda given, _: isinstance(given[0], (str, Path)),
)
@checked
class Recorder(KnownAttributes):
    """Records sensors row by row to the same files as :func:`mjsense.record`::

        with mjs.Recorder(sim, "data", sensors, episodes=2) as recorder:
            recorder.begin_episode(world=0, episode=0)
            recorder.append([0])                     # the observation after the reset
            for _ in range(100):
                sim.step()
                recorder.append([0], reward=[1.0])
            recorder.finish_episode(0, {"task_description": "walk"})

    Episodes are identified by their numbers, from ``first_attempt`` (0) without gaps; each is kept, discarded or abandoned. A
    finished episode is safe on disk. One that was not finished when the program died can be attempted again with ``resume=True``.
    The recording is completed at the end of the ``with`` block, unless an exception ends it.
    """

    def __init__(
        self,
        simulation: Simulation | WarpSimulation,
        out: str | Path,
        sensors: Iterable[Any] | None = None,
        *,
        # options of a recording
        episodes: int = 1,
        resume: bool = False,
        append: bool = False,
        overwrite: bool = False,
        house: int = 0,
        batches: int = 0,
        gzip: int = 4,
        ffmpeg: str = "",
        crf: int = 25,
        preset: str = "veryfast",
        tune: str = "fastdecode",
        keyint: int = 20,
        molmospaces_depth: bool = False,
        # end of options
        fps: float | Fraction | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """
        Args:
            simulation: The simulation to record. With ``backend="warp"`` the rows come to the host in one transfer for each
                ``append()``, and the recording cannot be replayed.
            out: Output directory; the files are in ``out/house_<house>/``.
            sensors: A :class:`SensorSuite` or sensors, in the order of the files; by default all of the scene. A camera becomes
                videos of its ``rgb`` and ``depth`` and arrays ``<camera>_<field>`` of its other fields. User-defined sensors need
                an ``observation_space`` or ``is_dict``.

            Options:
            episodes: Number of episodes to keep.
            resume: Continue an interrupted recording; all settings that affect the data must be unchanged.
            append: Add new episodes to a completed recording; all settings that affect the data must be unchanged.
            overwrite: Replace an existing recording of this house.
            house: Number of the ``house_N`` folder in the output directory. Each house of a task has its own random
                numbers.
            batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
            gzip: Compression level of arrays, 0 to 9.
            ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
            crf: Quality of the videos, from 0 (lossless) to 51 (worst).
            preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.
            tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
                seventh larger.
            keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
                makes files smaller.
            molmospaces_depth: Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video.
            Others:
            fps: Rows per second; by default one row per control step.
            settings: Settings that produced the data, as JSON. They are stored in every file and must be equal when a recording
                is resumed.
        """
        options = given_options("FilesCfg", locals())
        chosen, handles = recorded_sensors(simulation, sensors)
        self._simulation = simulation
        host_rows = getattr(simulation, "_host_rows", None)  # only WarpSimulation has it
        self._rows = host_rows(chosen) if host_rows else None
        rate = _rate(fps, simulation)
        text = json.dumps(dict(settings or {}), sort_keys=True, separators=(",", ":"))
        self._core = _core.Recorder(
            None if self._rows else simulation._core,
            simulation.num_worlds,
            self._rows.handles if self._rows else handles,
            str(out),
            rate.numerator,
            rate.denominator,
            text,
            options,
        )
        self._num_worlds = simulation.num_worlds
        self.sensors: tuple[Any, ...] = tuple(chosen)
        """The recorded sensors."""
        self._published = False
        self._complete = True

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if error is None:
            self.complete()

    def begin_episode(self, world: int, episode: int, seed: Seed = 0) -> None:
        """Starts recording rows of this world as an episode.

        Args:
            world: Id of the world.
            episode: Number of the episode.
            seed: Seed of the episode, which is stored with it.
        """
        self._core.begin_episode(world, episode, seed)

    def append(
        self,
        world_ids: Sequence[int] | None = None,
        *,
        reward: Any = 0.0,
        terminated: Any = False,
        truncated: Any = False,
        success: Any = False,
    ) -> None:
        """Records the current measurements of these worlds. Call once per observation.

        Args:
            world_ids: Worlds to record, ids or a mask; by default all that have an episode.
            reward, terminated, truncated, success: One value, or one for each of these worlds.
        """
        if self._published:
            raise RuntimeError("append: the recorder is complete; it takes no more rows")
        worlds = self._num_worlds
        ids = [w for w in range(worlds) if self.recording(w)] if world_ids is None else ids_of_worlds(world_ids, worlds).tolist()
        if world_ids is None and not ids:
            raise RuntimeError("append: no world records an episode: call begin_episode(world, episode) first")

        def column(name: str, value: Any, dtype: Any) -> list[Any]:
            array = np.asarray(value, dtype)
            if array.shape not in ((), (len(ids),)):
                raise ValueError(
                    f"append: {name} has shape {array.shape}, expected one value, or ({len(ids)},) for the worlds {ids}"
                )
            return np.broadcast_to(array, (len(ids),)).tolist()

        if self._rows:
            self._simulation.refresh(self.sensors)
            self._rows.read()
        flags = {"terminated": terminated, "truncated": truncated, "success": success}
        self._core.append(
            ids, column("reward", reward, np.float64), *(column(name, value, bool) for name, value in flags.items())
        )

    def finish_episode(self, world: int, obs_scene: Mapping[str, Any] | str | None = None, outcome: str = "") -> None:
        """Ends the episode of this world and keeps it.

        Args:
            world: Id of the world.
            obs_scene: Description of the episode (``task_description`` ...): a JSON object or its text.
            outcome: A word or a sentence.
        """
        text = obs_scene if isinstance(obs_scene, str) else json.dumps(dict(obs_scene or {}))
        self._core.finish_episode(world, text, outcome)

    def discard_episode(self, world: int, why: str = "") -> None:
        """Ends the episode of this world without keeping it. A resumed recording does not attempt it again."""
        self._core.discard_episode(world, why)

    def abandon_episode(self, world: int) -> None:
        """Leaves the episode of this world undecided: a resumed recording attempts it again."""
        self._core.abandon_episode(world)

    def flush(self) -> None:
        """Waits until every finished episode is safe on disk."""
        self._core.flush()

    def complete(self) -> None:
        """Publishes everything under its final name. No episode can be recorded afterwards."""
        self._published = True
        self._core.complete()

    def recording(self, world: int) -> bool:
        """Whether an episode of this world is being recorded."""
        return self._core.recording(world)

    def decided(self, episode: int) -> bool:
        """Whether this attempt was kept or discarded, now or before the recording was resumed."""
        return self._core.decided(episode)

    @property
    def first_attempt(self) -> int:
        """Number of the first episode: 0, or with ``append`` the one after those that are recorded."""
        return self._core.first_attempt

    @property
    def kept(self) -> int:
        """Number of episodes finished so far."""
        return self._core.kept

    @property
    def enough(self) -> bool:
        """Whether all episodes are kept and no earlier attempt is undecided."""
        return self._core.enough

    @property
    def path(self) -> Path:
        """Folder of the episodes."""
        return Path(self._core.path)

    @property
    def stats(self) -> dict[str, float]:
        """Rows, frames and bytes recorded so far, and seconds by activity."""
        return self._core.stats()


def recorded_sensors(simulation: Simulation | WarpSimulation, sensors: Iterable[Any] | None) -> tuple[list[Any], list[Any]]:
    """The sensors and their C++ handles; None: all of the scene. Adds those that belong to no simulation yet."""
    chosen = [as_sensor(sensor) for sensor in (simulation.scene.sensors.values() if sensors is None else sensors)]
    add_missing(simulation, chosen)
    handles = [recorded_handle(sensor) for sensor in chosen]
    SensorSuite(chosen)  # raises if names are not unique
    return chosen, handles


def recorded_handle(sensor: Any) -> Any:
    """The C++ handle of a sensor. Raises ValueError if it has no rows."""
    if not isinstance(sensor, Sensor):
        return sensor._handle
    if not sensor._mjs_fields:
        raise ValueError(f"sensor '{sensor.uuid}' cannot be recorded: give it an observation_space, or is_dict = True")
    return sensor._mjs_handle


def _rate(fps: float | Fraction | None, simulation: Simulation | WarpSimulation) -> Fraction:
    from fractions import Fraction  # slow to import

    if fps is None:
        return Fraction(1) / Fraction(simulation.step_dt).limit_denominator(10**6)
    rate = Fraction(fps).limit_denominator(10**6)
    if rate <= 0:
        raise ValueError(f"Recorder(): fps is {fps}: must be positive")
    return rate
