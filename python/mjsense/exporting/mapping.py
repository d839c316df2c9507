# SPDX-License-Identifier: Apache-2.0
"""Which streams of a recording become which features of an exported data set."""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Mapping as Table
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import read_toml
from mjsense.dataset import Dataset, Episode, Stream, Video
from mjsense.dataset.files import is_unfinished
from mjsense.dataset.streams import LARGE_ROW, VIDEOS, given_name
from mjsense.sensors.row_declarations import is_image

_OF_STEPS = ("actions/", "rewards", "success", "fail", "terminated", "truncated")
"""Row t of these streams belongs to the step that led to observation t."""
_RATE_CHANGE = 0.05
_JOINTS, _RELATIVE = "actions/joint_pos/", ("actions/joint_pos_rel/", "actions/ee_twist/")
_FLAGS = {"reward": ("rewards",), "success": ("success",), "terminated": ("terminated",), "truncated": ("truncated",)}


@dataclass(frozen=True)
class Mapping:
    """Streams of a recording by feature. A name stands for a stream or for a group of streams, in the order of their names; the
    numbers of all streams of a feature are concatenated."""

    state: tuple[str, ...] | None = None
    """Streams of the robot's state; None: ``obs/agent/qpos``, and in recordings of :class:`mjsense.RecordEpisodes` the
    observation without its images."""
    action: tuple[str, ...] | None = None
    """Streams of the action; None: ``actions/joint_pos``, and ``actions/commanded_action`` of move groups without joint targets;
    in recordings of :class:`mjsense.RecordEpisodes` ``actions/action``."""
    cameras: dict[str, str] | None = None
    """Cameras by exported name; None: all colour cameras with their own names."""
    features: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Streams of other features by exported name."""

    @staticmethod
    def of(source: Mapping | str | Path | Table[str, Any] | None) -> Mapping:
        """The mapping that a TOML file or a dict of the same form describes; None: the default mapping.

        Raises:
            FileNotFoundError: There is no such file.
            ValueError: The file is not valid TOML, an unknown key, or a value of the wrong type.
        """
        if isinstance(source, Mapping):
            return source
        if source is None:
            return Mapping()
        if isinstance(source, (str, Path)):
            table, about = read_toml(source), str(source)
        else:
            table, about = dict(source), "map"
        known = ("state", "action", "cameras", "features")
        if unknown := [key for key in table if key not in known]:
            raise ValueError(f"{about}: unknown key '{unknown[0]}'; the keys are {', '.join(known)}")
        for key in ("cameras", "features"):
            if not isinstance(table.get(key, {}), Table):
                raise ValueError(f"{about}: '{key}' must be a table of names")

        def streams(key: str, value: Any) -> tuple[str, ...]:
            names = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, (list, tuple)) else ()
            if not names or not all(isinstance(name, str) for name in names):
                raise ValueError(f"{about}: '{key}' must be the name of a stream or a list of names")
            return names

        made: dict[str, Any] = {key: streams(key, table[key]) for key in ("state", "action") if key in table}
        if "cameras" in table:
            made["cameras"] = {name: streams(f"cameras.{name}", camera)[0] for name, camera in table["cameras"].items()}
        made["features"] = {name: streams(f"features.{name}", value) for name, value in table.get("features", {}).items()}
        if taken := [name for name in made["features"] if name in (*known[:2], *_FLAGS)]:
            raise ValueError(f"{about}: the feature name '{taken[0]}' is taken; choose another")
        return Mapping(**made)


@dataclass(frozen=True)
class Feature:
    """Numbers of one step of an exported data set: a vector of the numbers of one or several streams."""

    name: str
    dtype: np.dtype[Any]
    names: tuple[str, ...]
    """Name of each number: ``arm_0``, ``arm_1``, ``gripper_0``."""
    parts: dict[str, slice]
    """Position of each stream's numbers by its short name: ``{"arm": slice(0, 7), "gripper": slice(7, 9)}``."""
    streams: tuple[str, ...]
    """Names of the streams in the recording."""
    of_step: bool
    """True: an action, a reward or another result of a step, with one row less than the observations."""

    @property
    def size(self) -> int:
        """Number of numbers."""
        return len(self.names)


@checked
class Source:
    """A recording as exports read it: chosen episodes, features, and cameras.

    Args:
        root: Output directory of a recording, one of its ``house_N`` folders, or one HDF5 file.
        map: A :class:`Mapping`, a TOML file, or a dict of the same form; by default :class:`Mapping`'s defaults.
        episodes: Positions of episodes in the recording; by default all.
        success: Only successful (True) or only failed (False) episodes.
        trim_idle: Leave out the steps in which nothing moves (:meth:`mjsense.dataset.Episode.trimmed`); None: in episodes whose
            task places an object.
        whole_rate: Round ``fps`` to a whole number, as formats need whose rates are whole numbers, if that changes it by at most
            5 %.
    """

    def __init__(
        self,
        root: str | Path,
        *,
        map: Mapping | str | Path | dict[str, Any] | None = None,
        episodes: Iterable[int] | None = None,
        success: bool | None = None,
        trim_idle: bool | None = False,
        whole_rate: bool = False,
    ) -> None:
        mapping = Mapping.of(map)
        chosen = Dataset(root, episodes=episodes, success=success)
        self.name: str = Path(root).resolve().name
        """Name of the recording's folder or file."""
        complete = (episode for episode in chosen.episodes if episode.length > 1)
        self.episodes: list[Episode] = [e.trimmed() if trim_idle or (trim_idle is None and places(e)) else e for e in complete]
        """The episodes that have at least one step."""
        if not self.episodes:
            raise ValueError(f"{root}: no episode with a step matches")
        self._notes: list[str] = []
        if without := len(chosen.episodes) - len(self.episodes):
            self._notes.append(
                f"{without} of {len(chosen.episodes)} episodes have one observation and no step; they are left out"
            )
        if episodes is None and is_unfinished(chosen.root):
            print(f"{root} is unfinished; the export has the episodes that are published", file=sys.stderr)
        self.first_step: int = 0
        """Number of steps of the episodes before, in a part of a recording."""
        self.recorded_fps: Fraction = chosen.fps
        """Observations per second, exactly."""
        self.fps: Fraction = _whole(chosen.fps) if whole_rate else chosen.fps
        """The rate that the export states."""
        self.robot: str = str(self.episodes[0].settings.get("robot", ""))
        """Name of the robot; empty if the recording does not state it."""
        known = dict(chosen.streams)
        state = _default_state(known) if mapping.state is None else mapping.state
        action = _default_action(known) if mapping.action is None else mapping.action
        wanted = {"state": state, "action": action, **mapping.features, **_FLAGS}
        if not state:  # an environment whose observation has no numbers
            del wanted["state"]
        self.features: dict[str, Feature] = {name: _feature(chosen, name, streams, known) for name, streams in wanted.items()}
        """``state``, ``action``, ``reward``, ``success``, ``terminated``, ``truncated``, and the mapping's other features.
        Without ``state`` if the recorded observation consists of images."""
        self.tasks: list[str] = list(dict.fromkeys(episode.task for episode in self.episodes))
        """The distinct instructions, in the order of their first episode."""
        colour = [
            name[len(VIDEOS) :] for name, stream in chosen.streams.items() if stream.kind == "video" and len(stream.shape) == 3
        ]
        if mapping.state is None:
            self._notes += [
                f"the image '{name}' is recorded as an array and left out; RecordEpisodes(image_videos=True) "
                "records RGB images as videos"
                for name in known
                if _observed(name) and _is_image(known[name])
            ]
        self.cameras: dict[str, str] = {camera: camera for camera in colour} if mapping.cameras is None else dict(mapping.cameras)
        """Names of cameras in the recording by exported name."""
        for camera in self.cameras.values():
            shapes = {episode.video(camera).shape[1:]: episode.index for episode in self.episodes}
            if len(shapes) > 1:
                sizes = ", ".join(f"{w}x{h} (episode {i})" for (h, w, *_), i in shapes.items())
                raise ValueError(f"{root}: the images of '{camera}' have different sizes: {sizes}; choose episodes of one size")

    def __len__(self) -> int:
        return len(self.episodes)

    def each(self, progress: Callable[[int, int], None] | None = None) -> Iterator[Episode]:
        """The episodes. After the work on each of them, ``progress`` is called with the number of finished ones and of all."""
        for finished, episode in enumerate(self.episodes, 1):
            yield episode
            if progress is not None:
                progress(finished, len(self))

    def part(self, begin: int, end: int) -> Source:
        """The episodes at the positions ``begin`` to ``end - 1``, with the same features and cameras."""
        part = copy.copy(self)
        part.episodes = self.episodes[begin:end]
        part.first_step = self.first_step + sum(episode.length - 1 for episode in self.episodes[:begin])
        return part

    def print_notes(self) -> None:
        """Prints on stderr what the export leaves out."""
        trimmed = sum(episode.trimmed_steps for episode in self.episodes)
        print_trimming(trimmed, trimmed + sum(episode.length - 1 for episode in self.episodes))
        for note in self._notes:
            print(note, file=sys.stderr)

    def rows(self, episode: Episode) -> dict[str, np.ndarray]:
        """Numbers of an episode by feature, ``[T, size]``, and ``[T - 1, size]`` of features of steps: row t of the action is the
        action that was taken at observation t.

        A move group without an action keeps its last one. Before its first action, a joint target is the measured position if
        that has the same size; otherwise, and in relative actions (``joint_pos_rel``, ``ee_twist``), it is 0.
        """
        names = {stream for feature in self.features.values() for stream in feature.streams}
        names |= {mask for name in names if (mask := given_name(name))} | {_measured(name) for name in names} - {""}
        loaded = episode._load(sorted(names))
        return {feature.name: self._rows(episode, feature, loaded) for feature in self.features.values()}

    def video(self, episode: Episode, camera: str) -> Video:
        """Frames of a camera by its exported name."""
        return episode.video(self.cameras[camera])

    def _rows(self, episode: Episode, feature: Feature, loaded: dict[str, np.ndarray]) -> np.ndarray:
        columns = []
        for stream, part in zip(feature.streams, feature.parts.values()):
            size = part.stop - part.start
            values = loaded.get(stream)
            mask = given_name(stream)
            if values is None and mask is None:
                raise UnknownNameError(
                    f"Episode {episode.index} ({episode.path.name}) has no stream '{stream}', which the feature "
                    f"'{feature.name}' needs"
                )
            if mask is not None:
                values = _filled(stream, values, loaded.get(mask), loaded.get(_measured(stream)), episode.length, size)
            assert values is not None
            columns.append(values.reshape(episode.length, size))
        rows = np.concatenate(columns, 1).astype(feature.dtype, copy=False)
        return rows[1:] if feature.of_step else rows


def places(episode: Episode) -> bool:
    """Whether the episode's task puts an object in, on or next to another one, as its recording says: one of its objects has the
    role ``place_receptacle``."""
    return "place_receptacle" in episode.obs_scene.get("objects", {}) or "place_receptacle_name" in episode.obs_scene


def print_trimming(trimmed: int, steps: int) -> None:
    """Prints on stderr how many of the recorded steps are left out, if any are."""
    if trimmed:
        share = f"{trimmed} of {steps} steps ({trimmed / steps:.0%})"
        print(f"{share}, in which nothing moves, are left out; --no-trim-idle (trim_idle=False) keeps them", file=sys.stderr)


def _whole(fps: Fraction) -> Fraction:
    """The nearest whole rate, or ``fps`` if that differs by more than 5 %."""
    whole = Fraction(max(1, round(fps)))
    return whole if abs(whole / fps - 1) <= _RATE_CHANGE else fps


def check_names(names: Iterable[tuple[str, str]]) -> None:
    """Raises ValueError if two things would have the same name in an export, where one of them would replace the other.

    Args:
        names: Names in the export, and what they belong to.
    """
    owners: dict[str, str] = {}
    for name, owner in names:
        if owners.setdefault(name, owner) != owner:
            raise ValueError(
                f"{owners[name]} and {owner} have the same name in the export, '{name}'; choose other names in the map"
            )


def named_streams(source: Source, features: Iterable[str], place: str = "", image: str = "") -> Iterator[tuple[str, str]]:
    """Names in an export, for :func:`check_names`: those of features and cameras, and of the depth images that formats add to
    cameras.

    Args:
        place: Start of the names, such as ``obs/``.
        image: End of the names of cameras.
    """
    yield from ((f"{place}{name}", f"the feature '{name}'") for name in features)
    yield from ((f"{place}{name}{image}", f"the video '{camera}'") for name, camera in source.cameras.items())
    known = source.episodes[0].streams if source.episodes else {}
    yield from (
        (f"{place}{name}_depth", f"the video '{camera}_depth'")
        for name, camera in source.cameras.items()
        if f"{VIDEOS}{camera}_depth" in known
    )


def _feature(chosen: Dataset, name: str, streams: tuple[str, ...], known: dict[str, Stream]) -> Feature:
    try:
        expanded = chosen._expand_all(streams, known)
    except UnknownNameError as error:
        raise UnknownNameError(f"Feature '{name}' (a map, map= or --map, chooses its streams): {error.args[0]}") from error
    found = list(dict.fromkeys(stream for stream in expanded if "/given/" not in stream))
    names: list[str] = []
    parts: dict[str, slice] = {}
    for stream in found:
        about = known[stream]
        if about.kind == "video" or about.dtype == object or about.dtype.itemsize * int(np.prod(about.shape)) >= LARGE_ROW:
            raise ValueError(
                f"The feature '{name}' cannot contain the stream {about}: it must be numbers, fewer than "
                f"{LARGE_ROW} bytes per row"
            )
        short = stream if "/" not in stream else stream.rsplit("/", 1)[1]
        short = short if short not in parts else stream
        size = int(np.prod(about.shape))
        parts[short] = slice(len(names), len(names) + size)
        names += [f"{short}_{i}" for i in range(size)] if about.shape else [short]
    if not names:
        raise ValueError(f"The feature '{name}' has no numbers: {', '.join(found)} is empty")
    of_step = {stream.startswith(_OF_STEPS) for stream in found}
    if len(of_step) != 1:
        raise ValueError(f"The feature '{name}' mixes observations and results of steps: {', '.join(found)}")
    return Feature(name, np.result_type(*(known[s].dtype for s in found)), tuple(names), parts, tuple(found), of_step.pop())


def _default_state(known: dict[str, Stream]) -> tuple[str, ...]:
    """Streams of the state; none if the observation of an environment has no numbers."""
    if any(name.startswith("obs/agent/qpos") for name in known):
        return ("obs/agent/qpos",)
    observed = [name for name in known if _observed(name)]
    numbers = [name for name in observed if not _is_image(known[name]) and np.prod(known[name].shape)]
    of_environment = any(f"{name}/".startswith("actions/action/") for name in known)
    return tuple(numbers) if observed or of_environment else ("obs/agent/qpos",)


def _observed(name: str) -> bool:
    """Whether the stream belongs to the observation of an environment that :class:`mjsense.RecordEpisodes` recorded."""
    return f"{name}/".startswith("obs/extra/observation/")


def _is_image(stream: Stream) -> bool:
    """Whether the rows of an observation are images, or as large as images."""
    return is_image(stream.dtype, stream.shape) or stream.dtype.itemsize * int(np.prod(stream.shape)) >= LARGE_ROW


def _default_action(known: dict[str, Stream]) -> tuple[str, ...]:
    if any(f"{name}/".startswith("actions/action/") for name in known):
        return ("actions/action",)
    commands = "actions/commanded_action/"
    groups = {name[len(commands) :] for name in known if name.startswith(commands) and "/given/" not in name} - {"success"}
    return "actions/joint_pos", *(commands + group for group in sorted(groups) if _JOINTS + group not in known)


def _measured(stream: str) -> str:
    """The measured positions of the move group of a joint target; of other streams the empty name."""
    return f"obs/agent/qpos/{stream.removeprefix(_JOINTS)}" if stream.startswith(_JOINTS) else ""


def _filled(
    stream: str, values: np.ndarray | None, given: np.ndarray | None, measured: np.ndarray | None, length: int, size: int
) -> np.ndarray:
    """Actions ``[length, size]`` in which rows without an action have the action before them; relative ones have 0."""
    before = np.zeros((length, size)) if measured is None or measured.size != length * size else measured
    if values is None or given is None:
        return before
    values = values.reshape(length, size)
    if stream.startswith(_RELATIVE):
        return values  # 0 where there is no action
    last = np.maximum.accumulate(np.where(given, np.arange(length), -1))
    return np.where((last >= 0)[:, None], values[last], before)
