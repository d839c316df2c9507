# SPDX-License-Identifier: Apache-2.0
"""The recorder itself, for loops of your own."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense._arguments import KnownAttributes, Seed, checked
from mjsense.sensor import Sensor, as_sensor
from mjsense.simulation import Simulation
from mjsense.suite import SensorSuite

if TYPE_CHECKING:
    from fractions import Fraction


@checked
class Recorder(KnownAttributes):
    """Keeps what sensors show, row by row, as the files that :func:`mjsense.record` writes::

        with mjs.Recorder("data", sim, sensors, episodes=2) as recorder:
            recorder.begin_episode(world=0, episode=0)
            recorder.append([0])                     # the observation after the reset
            for _ in range(100):
                sim.step()
                recorder.append([0], reward=[1.0])
            recorder.finish_episode(0, {"task_description": "walk"})

    An episode is kept or decided against by its number: from 0 on, without gaps. It is safe on disk once it is finished; what is
    not finished when the program dies can be attempted again with ``resume=True``. At the end of the ``with`` block, unless by an
    exception, the recording is completed.
    """

    def __init__(
        self,
        out: str | Path,
        simulation: Simulation,
        sensors: Iterable[Any] | None = None,
        *,
        episodes: int = 1,
        fps: float | Fraction | None = None,
        resume: bool = False,
        house: int = 0,
        batches: int = 0,
        gzip: int = 4,
        ffmpeg: str = "",
        crf: int = 24,
        preset: str = "veryfast",
        molmospaces_depth: bool = False,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """
        Args:
            out: folder; files are in ``out/house_<house>/``.
            simulation: its worlds are recorded.
            sensors: a :class:`SensorSuite` or sensors, in the order of the files; None: all of the scene. A camera becomes videos of
                its ``rgb`` and ``depth``; whatever else it has are arrays, ``<camera>_<field>``. Sensors of your own need an
                ``observation_space``, or ``is_dict``.
            episodes: how many to keep.
            fps: rows a second; by default one row a control step.
            resume: go on with an interrupted recording of the same settings.
            house: number of the ``house_N`` folder.
            batches: HDF5 files that episodes are spread over; 0: one for every four.
            gzip: compression of arrays, 0 to 9.
            ffmpeg: the program; by default ``$MJSENSE_FFMPEG``, else that of ``PATH``.
            crf: quality of videos, 0 lossless to 51.
            preset: effort of the video encoder, ultrafast to veryslow.
            molmospaces_depth: also depth as MolmoSpaces' loaders read it.
            settings: what made the data, as JSON; kept in every file, and equal where a recording is resumed.
        """
        chosen = list(simulation.scene.sensors.values() if sensors is None else sensors)
        chosen = [as_sensor(sensor) for sensor in chosen]
        for sensor in chosen:
            if (sensor._mjs_core if isinstance(sensor, Sensor) else sensor._core) is None:
                simulation.add(sensor)
            if isinstance(sensor, Sensor) and not sensor._mjs_fields:
                raise ValueError(f"sensor '{sensor.uuid}' cannot be recorded: give it an observation_space, or is_dict = True")
        SensorSuite(chosen)  # names are unique
        rate = _rate(fps, simulation)
        options = {
            "episodes": episodes, "resume": resume, "house": house, "batches": batches, "gzip": gzip, "ffmpeg": ffmpeg, "crf": crf,
            "preset": preset, "molmospaces_depth": molmospaces_depth,
        }  # fmt: skip
        handles = [sensor._mjs_handle if isinstance(sensor, Sensor) else sensor._handle for sensor in chosen]
        text = json.dumps(dict(settings or {}), sort_keys=True, separators=(",", ":"))
        self._core = _core.Recorder(
            simulation._core, handles, str(out), rate.numerator, rate.denominator, text, options
        )
        self._num_worlds = simulation.num_worlds
        self.sensors: tuple[Any, ...] = tuple(chosen)
        """What is stored."""
        self._published = False
        self._complete = True

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if error is None:
            self.complete()

    def begin_episode(self, world: int, episode: int, seed: Seed = 0) -> None:
        """From here on rows of this world belong to this episode.

        Args:
            world: which.
            episode: its number.
            seed: kept with it.
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
        """Stores what the sensors show of these worlds now; once an observation.

        Args:
            world_ids: None: all that have an episode.
            reward, terminated, truncated, success: one value, or one for each of these worlds.
        """
        if self._published:
            raise RuntimeError("append: the recorder is complete; it takes no more rows")
        ids = [w for w in range(self._num_worlds) if self.recording(w)] if world_ids is None else [int(w) for w in world_ids]

        def column(name: str, value: Any, dtype: Any) -> list[Any]:
            array = np.asarray(value, dtype)
            if array.shape not in ((), (len(ids),)):
                raise ValueError(f"append: {name} has shape {array.shape}, expected one value, or ({len(ids)},) for the worlds {ids}")
            return np.broadcast_to(array, (len(ids),)).tolist()

        self._core.append(
            ids,
            column("reward", reward, np.float64),
            column("terminated", terminated, bool),
            column("truncated", truncated, bool),
            column("success", success, bool),
        )

    def finish_episode(self, world: int, obs_scene: Mapping[str, Any] | str | None = None, outcome: str = "") -> None:
        """The episode of this world is whole, and kept.

        Args:
            world: which.
            obs_scene: what is to be known of the episode (``task_description`` ...): a JSON object, or its text.
            outcome: one word or sentence.
        """
        text = obs_scene if isinstance(obs_scene, str) else json.dumps(dict(obs_scene or {}))
        self._core.finish_episode(world, text, outcome)

    def discard_episode(self, world: int, why: str = "") -> None:
        """The episode of this world is not kept, and not attempted again."""
        self._core.discard_episode(world, why)

    def abandon_episode(self, world: int) -> None:
        """The episode of this world is undecided: a resumed recording attempts it again."""
        self._core.abandon_episode(world)

    def flush(self) -> None:
        """Waits until every finished episode is safe on disk."""
        self._core.flush()

    def complete(self) -> None:
        """Publishes everything under its final name. No more episodes after that."""
        self._published = True
        self._core.complete()

    def recording(self, world: int) -> bool:
        """Whether this world has an episode."""
        return self._core.recording(world)

    def decided(self, episode: int) -> bool:
        """Whether this attempt was kept or discarded, now or before the recording was resumed."""
        return self._core.decided(episode)

    @property
    def kept(self) -> int:
        """Episodes finished so far."""
        return self._core.kept

    @property
    def enough(self) -> bool:
        """All episodes are kept, and no earlier attempt is undecided."""
        return self._core.enough

    @property
    def path(self) -> Path:
        """The folder of the episodes."""
        return Path(self._core.path)

    @property
    def stats(self) -> dict[str, float]:
        """Rows, frames and bytes so far, and seconds by what they were spent on."""
        return self._core.stats()


def _rate(fps: float | Fraction | None, simulation: Simulation) -> Fraction:
    from fractions import Fraction  # slow to import

    if fps is None:
        return Fraction(1) / Fraction(simulation.step_dt).limit_denominator(10**6)
    rate = Fraction(fps).limit_denominator(10**6)
    if rate <= 0:
        raise ValueError(f"Recorder(): fps is {fps}: must be positive")
    return rate
