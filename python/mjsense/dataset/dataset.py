# SPDX-License-Identifier: Apache-2.0
"""Random access to the rows and frames of a recording."""

from __future__ import annotations

import bisect
import copy
import fnmatch
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core import representations
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.dataset import statistics
from mjsense.dataset.episode import Episode
from mjsense.dataset.episode_rows import Store
from mjsense.dataset.files import entries_of
from mjsense.dataset.places import printable
from mjsense.dataset.remote import resolved
from mjsense.dataset.streams import LARGE_ROW, REPLAY, Stream, given_name, is_mask

_PROBED = 16  # episodes of each recording whose JSON rows are read to know their leaves; about 10 ms each


@checked
class Dataset:
    """Observations of a recording by number: ``len(dataset)``, ``dataset[i]``. See docs/datasets.md.

    ``dataset[i]`` is a dict: a NumPy array for every stream, and ``episode_index``, ``frame_index``, ``index``, ``timestamp``
    (seconds since the start of the episode) and ``task`` (the instruction). It works with ``torch.utils.data.DataLoader`` and any
    number of workers, forked or spawned. Row t of ``actions/*`` is the action that led to observation t.

    Args:
        root: Output directory of a recording or of its shards, its ``index.parquet``, one of the ``house_N`` folders, one HDF5
            file, or an address that fsspec reads (``s3://bucket/pick``).
        episodes: Positions of episodes in the recording, or a mask; by default all.
        delta_timestamps: Windows: seconds relative to the observation, by stream or group. The stream becomes ``[n, ...]``, and
            ``{stream}_is_pad`` says which entries lie outside the episode; those repeat its first or last row.
        streams: Names of streams, of groups (``"obs/agent/qpos"``, ``"actions"``), or patterns (``"obs/sensor_data/*"``); by
            default all streams but ``replay/*``.
        outcome: Only episodes with this outcome: a text, a pattern (``"horizon reached*"``), several of them, or a function of
            the text.
        success: Only successful (True) or only failed (False) episodes.
        houses: Only episodes of these houses.
        where: Only episodes for which this function is true: ``lambda episode: episode.quality.idle < 0.1``.
        trim_idle: Leave out the steps in which nothing moves (:meth:`Episode.trimmed`). Numbers of observations, times and
            windows count what is left.
        tolerance_s: Maximum difference between an entry of ``delta_timestamps`` and a multiple of the period. [s]
        cache_mb: Memory for decoded rows and frames of one process, half for each. [MB]
    """

    def __init__(
        self,
        root: str | Path,
        *,
        episodes: Iterable[int] | None = None,
        delta_timestamps: Mapping[str, Sequence[float]] | None = None,
        streams: Iterable[str] | None = None,
        outcome: str | Iterable[str] | Callable[[str], bool] | None = None,
        success: bool | None = None,
        houses: Iterable[int] | None = None,
        where: Callable[[Episode], bool] | None = None,
        trim_idle: bool = False,
        tolerance_s: float = 1e-4,
        cache_mb: float = 512,
    ) -> None:
        self.root, source = resolved(root)
        """The folder or file; of an address, its copy on this machine."""
        if cache_mb < 0:
            raise ValueError(f"Dataset(): cache_mb is {cache_mb:g}: must be at least 0")
        entries, recordings = entries_of(self.root, source)
        self._store = Store(recordings, int(cache_mb * 1e6))
        chosen = [Episode(entry, i, self._store) for i, entry in enumerate(entries)]
        if episodes is not None:
            chosen = [chosen[i] for i in _numbers(episodes, len(chosen), self.root)]
        outcomes = [entry.outcome for entry in entries]
        if outcome is not None:
            wanted = outcome if callable(outcome) else [outcome] if isinstance(outcome, str) else list(outcome)
            for one in () if callable(wanted) else wanted:
                if not any(_matches(text, [one]) for text in set(outcomes)):
                    raise ValueError(f"outcome: no episode has the outcome {one!r}; {self.root} has {_common(outcomes)}")
            chosen = [episode for episode in chosen if _matches(episode.outcome, wanted)]
        if success is not None:
            chosen = [episode for episode in chosen if episode.success == success]
        if houses is not None:
            numbers, known = set(houses), {entry.house for entry in entries if entry.house is not None}
            if unknown := sorted(numbers - known):
                raise ValueError(f"houses: {unknown[0]} is not in {self.root}, which has the houses {sorted(known)}")
            chosen = [episode for episode in chosen if episode.house in numbers]
        if where is not None:
            chosen = [episode for episode in chosen if where(episode)]
        if trim_idle:
            chosen = [episode.trimmed() for episode in chosen]
        self.episodes: list[Episode] = chosen
        """The episodes, in the order of houses, files and positions in the file."""
        self._ends = list(itertools.accumulate(episode.length for episode in chosen))
        self._position = {episode.index: k for k, episode in enumerate(chosen)}
        self.streams: dict[str, Stream] = {}
        """The streams of a sample, by name."""
        self._fps = Fraction(0)
        self._windows: dict[str, list[int]] = {}
        if not chosen:
            if delta_timestamps or streams:
                raise ValueError(f"{self.root}: no episode matches; it has {_common(outcomes)}")
            return
        self._fps = self._common_fps()
        self._choose_streams(None if streams is None else list(streams), delta_timestamps or {}, tolerance_s)

    def _choose_streams(self, names: list[str] | None, windows: Mapping[str, Sequence[float]], tolerance_s: float) -> None:
        """Determines the streams of a sample, their windows, and how each is read."""
        known = self._known_streams()
        selected = (
            {name for name in known if not name.startswith(REPLAY)} if names is None else set(self._expand_all(names, known))
        )
        if names is None or not set(names) <= known.keys():
            self._store.leaves = set(known)
        for name, seconds in windows.items():
            steps = _steps(name, seconds, self._fps, tolerance_s)
            for stream in self._expand_all([name], known):
                self._windows[stream] = steps
                selected.add(stream)
        for name in list(selected):
            if (mask := given_name(name)) in known:
                selected.add(mask)
                if name in self._windows:
                    self._windows[mask] = self._windows[name]
        self.streams = {name: known[name] for name in sorted(selected)}
        self._arrays = [name for name, stream in self.streams.items() if self._in_memory(stream)]
        self._large = [name for name, stream in self.streams.items() if stream.kind != "video" and not self._in_memory(stream)]
        self._videos = [name for name, stream in self.streams.items() if stream.kind == "video"]

    @property
    def fps(self) -> Fraction:
        """Observations per second, exactly: ``Fraction(500, 33)``."""
        return self._fps

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index: int) -> dict[str, Any]:
        i = int(index)
        i = i + len(self) if i < 0 else i
        if not 0 <= i < len(self):
            raise IndexError(f"index {index} is out of range: {self.root} has {counted(len(self), 'observation')}")
        episode, t = self._place(i)
        sample: dict[str, Any] = Sample()
        arrays = episode._load_recorded(self._arrays)
        for name in self._arrays:
            rows, _ = self._rows(name, episode, t)
            sample[name] = self._values(name, arrays.get(name), rows)
        for name in self._large:
            rows, single = self._rows(name, episode, t)
            values = episode._large_rows(name, rows if isinstance(rows, list) else [rows])
            sample[name] = values[0] if single else values
        if self._videos:
            places = [self._rows(name, episode, t) for name in self._videos]
            frames = episode._frames(self._videos, [[rows] if single else rows for rows, single in places])
            sample |= {
                name: images[0] if single else np.stack(images) for name, images, (_, single) in zip(self._videos, frames, places)
            }
        for name, steps in self._windows.items():
            if not is_mask(name):
                sample[f"{name}_is_pad"] = np.array([not 0 <= t + step < episode.length for step in steps])
        sample |= {
            "episode_index": episode.index,
            "frame_index": t,
            "index": i,
            "timestamp": float(t / self._fps),
            "task": episode.task,
        }
        return sample

    def __repr__(self) -> str:
        outcomes = Counter(episode.outcome for episode in self.episodes)
        lines = [f"Dataset({str(self.root)!r}): {counted(len(self.episodes), 'episode')}, {counted(len(self), 'observation')}"]
        lines += [f"  {count} x {printable(outcome)}" for outcome, count in outcomes.most_common()]
        return "\n".join(lines + [f"  {stream}" for stream in self.streams.values()])

    def _repr_html_(self) -> str:
        """HTML for notebooks: the outcomes, images of the first episode, and all streams, folded."""
        outcomes = Counter(episode.outcome for episode in self.episodes)
        rows = [(count, outcome) for outcome, count in outcomes.most_common()]
        table = representations.grid(("episodes", "outcome"), rows)
        streams = [(s.name, s.dtype, list(s.shape), s.unit, s.frame, s.description) for s in self.streams.values()]
        folded = {
            counted(len(streams), "stream"): representations.grid(("stream", "dtype", "shape", "unit", "frame", ""), streams)
        }
        first = self.episodes[0]._film() if self.episodes else ""
        return representations.block(
            f"data set {self.root}: {counted(len(self.episodes), 'episode')}, {counted(len(self), 'observation')}",
            table + first,
            folded,
        )

    def index_of(self, episode: int, frame: int = 0) -> int:
        """Number of an observation: ``frame`` of the episode at position ``episode`` in the recording."""
        if episode not in self._position:
            raise ValueError(f"episode {episode} is not in this data set")
        k = self._position[episode]
        length = self.episodes[k].length
        if not -length <= frame < length:
            raise ValueError(f"frame {frame} is not in episode {episode}, which has {counted(length, 'observation')}")
        return self._ends[k] - length + frame % length

    def stats(self, streams: Iterable[str] | None = None, *, frames: int = 200) -> dict[str, dict[str, np.ndarray]]:
        """min, max, mean, std, count, q01, q10, q50, q90 and q99 of each stream over all observations.

        NaN is skipped, as are rows of actions that are not given. Images have the shape (3, 1, 1) and the range 0 to 1. Texts and
        streams with rows of 64 kB or more (segmentation) have no statistics.

        Args:
            streams: Names, groups or patterns; by default the streams of this data set.
            frames: Maximum number of frames of each camera, evenly spaced; of a depth image at most about 20,000 pixels count.
        """
        if frames < 1:
            raise ValueError(f"frames is {frames}; it must be at least 1")
        if not self.episodes:
            return {}
        known = dict(self.streams) if streams is None else self._known_streams()
        names = list(known) if streams is None else self._expand_all(streams, known)
        arrays = [name for name in names if self._in_memory(known[name]) and known[name].dtype != object and not is_mask(name)]
        masks = {name: mask for name in arrays if (mask := given_name(name))}
        parts: dict[str, list[np.ndarray]] = {name: [] for name in arrays}
        for episode in self.episodes:
            loaded = episode._load([*arrays, *masks.values()])
            for name in arrays:
                if name in loaded:
                    given = loaded.get(masks.get(name, ""))
                    parts[name].append(loaded[name] if given is None else loaded[name][given])
        result = {name: statistics.of_rows(rows) for name in arrays if parts[name] and len(rows := np.concatenate(parts[name]))}
        chosen = np.unique(np.linspace(0, len(self) - 1, min(frames, len(self))).astype(int))
        places = [self._place(int(i)) for i in chosen]
        for name in (name for name in names if known[name].kind == "video"):
            pictures = (episode.video(name)[t] for episode, t in places)
            result[name] = (statistics.of_images if known[name].dtype == np.uint8 else statistics.of_depth)(pictures)
        return dict(sorted(result.items()))

    def _common_fps(self) -> Fraction:
        first = self.episodes[0]
        for episode in {episode._entry.recording: episode for episode in self.episodes}.values():
            if episode.fps != first.fps:
                raise ValueError(
                    f"{first.path} has {first.fps} observations per second, {episode.path} has {episode.fps}; "
                    "choose houses with one rate"
                )
        return first.fps

    def _expand_all(self, names: Iterable[str], known: dict[str, Stream]) -> list[str]:
        """Streams that names, groups and patterns stand for. An unknown name is looked up in all episodes; ``known`` receives
        it."""
        result: list[str] = []
        for name in names:
            try:
                result += _expand(name, known)
            except UnknownNameError:
                leaf = next(
                    (e._streams[name] for e in self.episodes if name in e._streams and e._streams[name].kind == "json"), None
                )
                if leaf is None:
                    raise
                known[name] = leaf
                result.append(name)
        return result

    def _known_streams(self) -> dict[str, Stream]:
        """Streams that all recordings have. JSON leaves are those of up to 16 episodes of each recording, the first and the last
        included."""
        groups: dict[int, list[Episode]] = {}
        for episode in self.episodes:
            groups.setdefault(episode._entry.recording, []).append(episode)
        tables: list[dict[str, Stream]] = []
        for group in groups.values():
            probed = np.unique(np.linspace(0, len(group) - 1, min(_PROBED, len(group))).astype(int))
            tables.append({name: stream for k in reversed(probed) for name, stream in group[k]._streams.items()})
        return {name: stream for name, stream in tables[0].items() if all(name in table for table in tables)}

    def _place(self, i: int) -> tuple[Episode, int]:
        """Episode and row of an observation."""
        k = bisect.bisect_right(self._ends, i)
        return self.episodes[k], i - self._ends[k] + self.episodes[k].length

    @staticmethod
    def _in_memory(stream: Stream) -> bool:
        return stream.kind != "video" and _row_bytes(stream) < LARGE_ROW

    def _rows(self, name: str, episode: Episode, t: int) -> tuple[Any, bool]:
        """The row in the recording of observation ``t`` and True, or the rows of its window, inside the episode, and False."""
        steps = self._windows.get(name)
        kept = range(episode.length) if episode._kept is None else episode._kept
        if steps is None:
            return int(kept[t]), True
        return [int(kept[min(max(t + step, 0), episode.length - 1)]) for step in steps], False

    def _values(self, name: str, array: np.ndarray | None, rows: Any) -> Any:
        stream = self.streams[name]
        if array is None:  # a JSON leaf that no row of this episode has
            if stream.kind != "json":
                raise UnknownNameError(f"{self.root}: an episode has no stream '{name}'; leave it out with streams=")
            shape = stream.shape if isinstance(rows, int) else (len(rows), *stream.shape)
            return (
                "" if stream.dtype == object and not shape else np.full(shape, "" if stream.dtype == object else 0, stream.dtype)
            )
        if array.shape[1:] != stream.shape:
            raise ValueError(
                f"{self.root}: '{name}' has the shape {list(array.shape[1:])} in one episode, {list(stream.shape)} in the first"
            )
        values = array[rows]
        return copy.deepcopy(values) if array.dtype == object else np.array(values)  # a copy: the array is in the cache


def opened(root: str | Path | Dataset, episodes: Iterable[int] | None) -> Dataset:
    """The data set itself, or that of a recording with these episodes."""
    if not isinstance(root, Dataset):
        return Dataset(root, episodes=episodes)
    if episodes is not None:
        raise ValueError("episodes= cannot be combined with a Dataset; choose them when it is created")
    return root


def by_house(episodes: Iterable[Episode]) -> list[list[Episode]]:
    """The episodes of each house. A house has one folder name, and may be in many shards."""
    houses: dict[str, list[Episode]] = {}
    for episode in episodes:
        houses.setdefault(episode.path.parent.name, []).append(episode)
    return list(houses.values())


def _row_bytes(stream: Stream) -> int:
    return int(np.prod(stream.shape, dtype=np.int64)) * stream.dtype.itemsize


def _numbers(episodes: Iterable[int], count: int, root: Path) -> list[int]:
    """Positions of the episodes that numbers or a mask select."""
    array = np.asarray(list(episodes))
    if array.dtype == bool:
        if array.shape != (count,):
            raise ValueError(f"episodes: a mask of {array.size}, but {root} has {counted(count, 'episode')}")
        return np.flatnonzero(array).tolist()
    if array.size and array.dtype.kind not in "iu":
        raise TypeError(f"episodes must be integers or a mask, not {episodes!r:.100}")
    for i in array.tolist():
        if not 0 <= i < count:
            raise ValueError(f"episodes: {i} is not in {root}, which has {counted(count, 'episode')}")
    return array.tolist()


def _common(outcomes: Sequence[str]) -> str:
    """The ten most common outcomes, with their numbers."""
    counts = Counter(outcomes)
    common = [f"{count} x {printable(text)!r}" for text, count in counts.most_common(10)]
    return ", ".join(common + ["..."] * (len(counts) > 10)) or "no episodes"


def _matches(outcome: str, wanted: Sequence[str] | Callable[[str], bool]) -> bool:
    if callable(wanted):
        return bool(wanted(outcome))
    return any(outcome == one or fnmatch.fnmatchcase(outcome, one) for one in wanted)


class Sample(dict[str, Any]):
    """An observation of a data set: its values by stream. The error for a name that is missing has the nearest names."""

    def __missing__(self, name: str) -> Any:
        raise UnknownNameError(f"the observation has no '{name}'{did_you_mean(name, self, 'it has')}")


def groups_of(streams: Iterable[str]) -> list[str]:
    """The groups of these streams, such as ``obs/agent/qpos``."""
    return sorted({"/".join(stream.split("/")[:n]) for stream in streams for n in range(1, stream.count("/") + 1)})


def _expand(name: str, known: Mapping[str, Stream]) -> list[str]:
    """The streams that a name, a group or a pattern stands for."""
    if name in known:
        return [name]
    found = [stream for stream in known if stream.startswith(f"{name}/")] or fnmatch.filter(known, name)
    if not found:
        raise UnknownNameError(f"No stream, group or pattern '{name}'{did_you_mean(name, [*known, *groups_of(known)])}")
    return found


def _steps(name: str, seconds: Sequence[float], fps: Fraction, tolerance_s: float) -> list[int]:
    try:
        steps = [round(float(s) * float(fps)) for s in seconds]
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"delta_timestamps['{name}'] is {seconds!r:.100}: must be a list of numbers, in seconds") from None
    off = [s for s, n in zip(seconds, steps) if abs(float(s) - n / float(fps)) > tolerance_s]
    if off:
        nearest = round(off[0] * float(fps)) or (1 if off[0] > 0 else -1)
        raise ValueError(
            f"delta_timestamps['{name}']: {off[0]} s is not a multiple of 1/fps = {float(1 / fps):.6f} s within {tolerance_s} s; "
            f"use n / dataset.fps, such as {nearest} / dataset.fps = {float(nearest / fps):.6f} s"
        )
    return steps
