# SPDX-License-Identifier: Apache-2.0
"""Recomputes the sensors of a recording from its states, and compares every stream with the recorded one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core.declared_fields import declared_fields
from mjsense.core.installed_files import use_installed_meshes
from mjsense.dataset import bounded_json, json_rows, render_cameras
from mjsense.dataset.dataset import Dataset, by_house
from mjsense.dataset.description import named_file
from mjsense.dataset.deviation import Deviation
from mjsense.dataset.episode_worlds import EpisodeWorlds, show_states
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.hdf5_rows import Rows
from mjsense.dataset.hdf5_values import text_of
from mjsense.dataset.limits import TEXT_BYTES
from mjsense.dataset.model_fields import ReplayInputs
from mjsense.dataset.places import open_plain
from mjsense.dataset.playback import fields_of, inputs_of
from mjsense.dataset.streams import VIDEOS
from mjsense.recording.ffmpeg import use_installed_ffmpeg
from mjsense.recording.recorder import recorded_sensors
from mjsense.scene.physics_options import PREFIX
from mjsense.scene.randomizable import field_of
from mjsense.sim.simulation import Simulation

if TYPE_CHECKING:
    from mjsense.dataset.episode import Episode

_CHUNK = 8  # episodes whose recomputed sensors are on disk at the same time
_NOT_COMPARED = {"terminated", "truncated", "obs_scene"}  # of the policy and of the recording's horizon
_OF_TASK = {"rewards", "success", "fail"}
_OF_POLICY = "belongs to the policy, or to a sensor that the caller passed"


@dataclass
class SensorCheck:
    """Comparison of the sensors of one episode."""

    equal: list[str] = field(default_factory=list)
    """Streams that are equal bit for bit."""
    deviations: list[Deviation] = field(default_factory=list)
    """First deviation of each other stream."""
    not_computed: dict[str, str] = field(default_factory=dict)
    """Streams that do not follow from the model and the state, with the reason."""

    @property
    def ok(self) -> bool:
        """Whether every stream that was computed is equal."""
        return not self.deviations


class _Rebuilt:
    """The worlds of the recording's task, rebuilt from its settings: they have all of its sensors but those of the policy. Each
    step is simulated from the recorded state with the recorded controls, so that sensors with a memory are right, too."""

    def __init__(self, episode: Episode, num_worlds: int, threads: int) -> None:
        settings = episode._recording.settings
        cameras = settings["cameras"]
        options = {key: settings[key] for key in declared_fields("RolloutCfg") if key in settings}
        options |= {
            "policy": "",
            "replay_sensor": True,
            "num_worlds": num_worlds,
            "threads": threads,
            "cameras": [camera["name"] for camera in cameras],
        }
        for side in ("width", "height"):
            sizes = {camera[side] for camera in cameras}
            options[side] = sizes.pop() if len(sizes) == 1 else None
        for kind in ("depth", "segmentation"):
            options[kind] = bool(cameras) and all(camera.get(kind, False) for camera in cameras)
        if episode.seed is not None:  # that of the house, which differs from the setting
            options["seed"] = episode.seed
        if options["meshes"] == "real":
            use_installed_meshes()
        self._rollout = _core.Rollout(options, (None, None, [], None, {}, [], None), Simulation._of)
        self.sim: Any = self._rollout.simulation()
        stored = inputs_of(episode).state.shape[1]
        if self.sim.state.shape[1] != stored:
            raise ValueError(
                f"the recorded state has {stored} numbers, that of the task in this version has {self.sim.state.shape[1]}"
            )
        self.handles: list[Any] = []
        self.reasons: dict[str, str] = {}
        self._optional: set[str] = set()
        """Options in which an episode has differed from the task's."""
        for handle, _ in self._rollout.sensors():
            if handle.name.startswith("actions/"):
                self.reasons[handle.name] = "the action that the policy chose"
            else:
                self.handles.append(handle)

    def begin(self, world: int, episode: Episode) -> None:
        self._rollout.start([world], [episode.number])
        options = fields_of(episode, self.sim.model, PREFIX)  # of a policy that sets options
        for name in {*options, *self._optional}:
            rows = self.sim.model_field(name)
            rows[world] = field_of(self.sim.model, name)
            values = options[name] if name in options else rows[world]
            rows[world] = np.where(np.isnan(values), rows[world], np.reshape(values, rows[world].shape))
        self._optional |= options.keys()
        if self._optional:
            self.sim._core.options_changed()
        self._set(world, inputs_of(episode).state[0])

    def evaluations(self) -> tuple[np.ndarray, np.ndarray]:
        """(reward, success) of each world."""
        return self._rollout.outcomes()[:2]

    def _set(self, world: int, state: np.ndarray) -> None:
        if self.sim.state[world].tobytes() != state.tobytes():
            self.sim.state[world] = state
            self.sim.invalidate([world])

    def show(self, playing: list[tuple[int, Episode]], t: int) -> None:
        if t == 0:
            return
        for w in {*range(self.sim.num_worlds)} - {w for w, _ in playing}:
            self._rollout.stop(w)
        self._rollout.repeat([(w, *_written(inputs_of(episode), t)) for w, episode in playing])
        for w, episode in playing:
            self._set(w, inputs_of(episode).state[t])


def _written(inputs: ReplayInputs, t: int) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """What was written before the step to observation ``t``: rows of the state, and of the controls and mocap poses by control
    tick."""
    ctrl, mocap = (None if rows is None else np.ascontiguousarray(rows[t]).ravel() for rows in (inputs.ctrl, inputs.mocap))
    return np.ascontiguousarray(inputs.written[t]), ctrl, mocap


class _Archived:
    """The archived model with the recorded cameras, for recordings whose task cannot be rebuilt."""

    def __init__(self, episode: Episode, num_worlds: int, threads: int) -> None:
        settings = episode._recording.settings
        cameras = [] if render_cameras.shows_file(settings) else render_cameras.recorded_cameras(episode, None)
        images = render_cameras.recorded_images(settings) if cameras else {}
        views = [camera.scene_sensor(images) for camera in cameras]
        self._worlds = EpisodeWorlds(
            episode, num_worlds, views, brightness=settings.get("render", {}).get("brightness", 1.0), threads=threads
        )
        self.sim = self._worlds.sim
        self._sensors, self.handles = recorded_sensors(self.sim, [stream for camera in cameras for stream in camera.streams()])
        self.reasons: dict[str, str] = {}

    def begin(self, world: int, episode: Episode) -> None:
        self._worlds.begin(world, episode)

    def show(self, playing: list[tuple[int, Episode]], t: int) -> None:
        show_states(self.sim, [w for w, _ in playing], [inputs_of(episode).state[t] for _, episode in playing])

    def evaluations(self) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(self.sim.num_worlds), np.zeros(self.sim.num_worlds, bool)


def _worlds_of(episode: Episode, num_worlds: int, threads: int) -> tuple[Any, str]:
    """The worlds, and the reason for streams that they do not have."""
    settings = episode._recording.settings
    if files := named_file(settings):
        return _Archived(episode, num_worlds, threads), f"of a file that the recording names is not read: {files}"
    if "render" in settings:
        return _Archived(episode, num_worlds, threads), "carried over from the recording that was rendered"
    if "task" in settings.get("code", {}):
        return _Archived(
            episode, num_worlds, threads
        ), f"belongs to the task '{settings.get('task')}', which is written in Python"
    try:
        return _Rebuilt(episode, num_worlds, threads), _OF_POLICY
    except (KeyError, ValueError, RuntimeError, OSError) as error:
        reason = error.args[0] if error.args else error
        return _Archived(episode, num_worlds, threads), f"the task cannot be built again: {reason}"


def _recompute(worlds: Any, episodes: list[Episode], out: Path) -> None:
    """Records the sensors of these episodes on their recorded states, under the numbers 0, 1, ..."""
    first = episodes[0]
    rate = Fraction(first.fps)
    video = first._recording.video or {}
    options = {"episodes": len(episodes), "batches": 1, "gzip": 0} | video
    recorder = _core.Recorder(
        worlds.sim._core, worlds.sim.num_worlds, worlds.handles, str(out), rate.numerator, rate.denominator, "{}", options
    )
    for start in range(0, len(episodes), worlds.sim.num_worlds):
        playing = list(enumerate(episodes[start : start + worlds.sim.num_worlds]))
        for w, episode in playing:
            worlds.begin(w, episode)
            recorder.begin_episode(w, start + w, 0)
        for t in range(max(episode.length for _, episode in playing)):
            active = [(w, episode) for w, episode in playing if t < episode.length]
            ids, none = [w for w, _ in active], [False] * len(active)
            worlds.show(active, t)
            reward, success = worlds.evaluations()
            recorder.append(ids, reward[ids].tolist(), none, none, success[ids].tolist())
        for w, _ in playing:
            recorder.finish_episode(w, "{}", "")
    recorder.complete()


def _text_deviation(name: str, recorded: np.ndarray, replayed: np.ndarray, t: int) -> Deviation:
    """The first leaf that differs in a row of JSON text."""
    a, b = (json_rows.decode(rows[t : t + 1]) for rows in (recorded, replayed))
    differing = [leaf for leaf in sorted({*a, *b}) if leaf not in a or leaf not in b or not _same(a[leaf][0], b[leaf][0])]
    if not differing:
        return Deviation(t, name, "the text", text_of(recorded[t].tobytes()), text_of(replayed[t].tobytes()), 1)
    leaf = differing[0]
    was, now = (found[leaf][0][0].tolist() if leaf in found else None for found in (a, b))
    return Deviation(t, name, f"key '{leaf.lstrip('/')}'", was, now, len(differing))


def _same(a: Any, b: Any) -> bool:
    return all(np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in zip(a, b))


def _array_deviation(name: str, recorded: np.ndarray, replayed: np.ndarray) -> Deviation | None:
    """The first row and value that differ, in bits; NaN equals NaN."""
    if recorded.shape != replayed.shape or recorded.dtype != replayed.dtype:
        was, now = (f"{rows.dtype}{list(rows.shape)}" for rows in (recorded, replayed))
        return Deviation(0, name, "the shape", was, now, 1)
    if recorded.tobytes() == replayed.tobytes():
        return None
    words = [
        np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1, rows.dtype.itemsize) for rows in (recorded, replayed)
    ]
    differs = (words[0] != words[1]).any(2)
    t = int(differs.any(1).argmax())
    first = int(differs[t].argmax())
    place = np.unravel_index(first, recorded.shape[1:]) if recorded.ndim > 1 else ()
    was, now = (rows[t][place].item() for rows in (recorded, replayed))
    return Deviation(t, name, f"value {[int(i) for i in place]}", was, now, int(differs[t].sum()))


def _video_deviation(name: str, recorded: Episode, replayed: Episode) -> Deviation | None:
    """The encoder gives the same bytes for the same images; other bytes are decoded and compared."""
    a, b = recorded.video(name), replayed.video(name)
    with open_plain(a.path) as old, open_plain(b.path) as new:
        if old.size == new.size and old.read() == new.read():
            return None
    for t in range(min(len(a), len(b))):
        if found := _array_deviation(name, a[t][None], b[t][None]):
            return Deviation(t, name, found.element.replace("value", "pixel"), found.recorded, found.replayed, found.count)
    return None


def _sensor_of(dataset: Rows) -> str:
    """Name of the sensor of a stream."""
    return str(
        bounded_json.parse_object(dataset.attrs.text("spec", "{}"), f"{dataset.where}: the attribute 'spec'", TEXT_BYTES).get(
            "sensor", ""
        )
    )


def _compare(recorded: Episode, replayed: Episode, worlds: Any, otherwise: str) -> SensorCheck:
    check, has_task = SensorCheck(), isinstance(worlds, _Rebuilt)
    with open_h5(recorded.path) as old_file, open_h5(replayed.path) as new_file:
        old, new = old_file[recorded.trajectory], new_file[replayed.trajectory]
        names = [name for name in old.datasets() if isinstance(old[name], Rows) and (old[name].is_number or name == "obs_scene")]
        for name in names:
            if name in _NOT_COMPARED or name.startswith("replay/"):
                continue
            if name not in new or (name in _OF_TASK and not has_task):
                if name.startswith("numbers/"):  # the same as in the sensor's JSON rows
                    continue
                sensor = _sensor_of(old[name])
                check.not_computed[name] = worlds.reasons.get(sensor, otherwise)
                continue
            if name.startswith(VIDEOS):
                found = _video_deviation(name, recorded, replayed)
            else:
                found = _array_deviation(name, old[name][:], new[name][:])
                if found and old[name].attrs.text("encoding") == "json":
                    found = _text_deviation(name, old[name][:], new[name][:], found.step)
            if found:
                check.deviations.append(found)
            else:
                check.equal.append(name)
    return check


def check_sensors(episodes: list[Episode], *, worlds: int = 4, threads: int = 0) -> Iterator[tuple[Episode, SensorCheck]]:
    """Yields the comparison of every episode."""
    use_installed_ffmpeg()
    for chosen in by_house(episodes):
        playing, otherwise = _worlds_of(chosen[0], min(worlds, len(chosen)), threads)
        for start in range(0, len(chosen), _CHUNK):
            some = chosen[start : start + _CHUNK]
            with tempfile.TemporaryDirectory(prefix="mjsense") as out:
                _recompute(playing, some, Path(out))
                for recorded, replayed in zip(some, Dataset(out).episodes):
                    yield recorded, _compare(recorded, replayed, playing, otherwise)
