# SPDX-License-Identifier: Apache-2.0
"""LeRobot v3.0: episodes concatenated in Parquet and MP4 files. The videos are copied, not encoded again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mjsense._arguments import checked
from mjsense.dataset import Episode, statistics
from mjsense.export import lerobot_depth
from mjsense.export.frame_statistics import DEFAULT_FRAMES, check_frames, frame_histograms
from mjsense.export.images import video_file
from mjsense.export.mapping import Feature, Mapping, Source
from mjsense.export.output import needs, new_output
from mjsense.export.remux import Concatenation

FILES_PER_CHUNK = 1000
DATA_FILE_MB, VIDEO_FILE_MB = 100, 200
_TOLERANCE_S = 1e-4  # LeRobot's tolerance of times of frames
Histograms = Callable[[Path, int, "int | Literal['key']"], tuple[np.ndarray, int]]
"""A function with the arguments and the result of ``frame_histograms``."""
_PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"


@checked
def export_lerobot(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool = False,
    statistics_frames: int | Literal["key"] = DEFAULT_FRAMES,
    histograms: Callable[..., Any] = frame_histograms,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a LeRobot v3.0 data set. See docs/export.md.

    Args:
        root: Output directory of a recording, one of its ``house_N`` folders, or one HDF5 file.
        out: Folder of the data set, which must not exist.
        map: Features and cameras: a :class:`mjsense.export.Mapping`, a TOML file, or a dict of the same form.
        episodes: Positions of episodes in the recording; by default all.
        success: Only successful (True) or only failed (False) episodes.
        trim_idle: Leave out the steps in which nothing moves (:meth:`mjsense.Episode.trimmed`). Their videos are encoded again.
        statistics_frames: Frames that the statistics of images use. ``key``: the key frames, which are every 20th unless the recording was
            made with another ``keyint``; a number: at most so many frames of each episode and camera; 0: all, which takes ten times as long.
        histograms: Function that computes the histograms of a video, in place of ``mjsense.export.frame_statistics.frame_histograms``.
        progress: Called with the number of written episodes and of all episodes.

    Returns:
        ``out``.
    """
    check_frames(statistics_frames)
    source = Source(root, map=map, episodes=episodes, success=success, trim_idle=trim_idle)
    with new_output(out) as path:
        writer = Writer(source, path, statistics_frames, histograms)
        for n, episode in enumerate(source.episodes, 1):
            writer.add(episode)
            if progress:
                progress(n, len(source))
        writer.close()
    return Path(out)


def key_of(feature: Feature) -> str:
    """LeRobot's name of a feature. A name with a dot stays as it is."""
    if feature.name == "action" or "." in feature.name:
        return feature.name
    return f"{'next' if feature.of_step else 'observation'}.{feature.name}"


def image_key(camera: str) -> str:
    return f"observation.images.{camera}"


def is_depth(source: Source, camera: str) -> bool:
    return len(source.video(source.episodes[0], camera).shape) == 3


def exported(source: Source) -> list[Feature]:
    """The features that become columns. LeRobot has ``next.done`` instead of ``terminated`` and ``truncated``."""
    return [feature for name, feature in source.features.items() if name not in ("terminated", "truncated")]


def features_of(source: Source, codec: dict[str, Any]) -> dict[str, Any]:
    """The entry ``features`` of ``meta/info.json``."""
    found: dict[str, Any] = {}
    for feature in exported(source):
        found[key_of(feature)] = {"dtype": _dtype(feature.dtype), "shape": [feature.size], "names": list(feature.names)}
    found["next.done"] = {"dtype": "bool", "shape": [1], "names": ["done"]}
    for camera in source.cameras:
        height, width = _stored_size(source.video(source.episodes[0], camera).shape)
        special = lerobot_depth.INFO if is_depth(source, camera) else {"is_depth_map": False, "video.channels": 3, **codec}
        info = {"video.height": height, "video.width": width, "video.fps": number(source.fps), "has_audio": False, **special}
        shape = [height, width, info["video.channels"]]
        found[image_key(camera)] = {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"], "info": info}
    found["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    for name in ("frame_index", "episode_index", "index", "task_index"):
        found[name] = {"dtype": "int64", "shape": [1], "names": None}
    return found


def columns_of(source: Source, episode: Episode, position: int, first_index: int, task_index: int) -> dict[str, np.ndarray]:
    """Columns of an episode: ``[T - 1, size]``, and ``[T - 1]`` of single numbers. The last observation has no action and is left out."""
    rows = source.rows(episode)
    length = episode.length - 1
    columns = {key_of(feature): rows[feature.name][:length].astype(_dtype(feature.dtype)) for feature in exported(source)}
    columns["next.done"] = np.arange(length) == length - 1
    columns["timestamp"] = times(length, source.fps).astype(np.float32)
    columns["frame_index"] = np.arange(length)
    columns["episode_index"] = np.full(length, position)
    columns["index"] = first_index + np.arange(length)
    columns["task_index"] = np.full(length, task_index)
    return {name: column[:, 0] if column.ndim == 2 and column.shape[1] == 1 else column for name, column in columns.items()}


def table_of(columns: dict[str, np.ndarray]) -> Any:
    """An Arrow table; vectors are lists of fixed size."""
    pa = needs("pyarrow")
    arrays = {}
    for name, values in columns.items():
        flat = pa.array(np.ascontiguousarray(values).reshape(-1))
        arrays[name] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    return pa.table(arrays)


def times(length: int, fps: Fraction, first: int = 0) -> np.ndarray:
    """Times of ``length`` frames from the frame ``first`` on, rounded once to float64. [s]"""
    return (first + np.arange(length)) * fps.denominator / fps.numerator


def number(fps: Fraction) -> int | float:
    return int(fps) if fps.denominator == 1 else float(fps)


def lists(stats: dict[str, np.ndarray]) -> dict[str, Any]:
    """Statistics as JSON and Arrow take them."""
    return {name: value.tolist() for name, value in stats.items()}


def write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False))


def codec_of(path: Path) -> dict[str, Any]:
    with needs("av").open(str(path)) as video:
        context = video.streams.video[0].codec_context
        return {"video.codec": context.codec.canonical_name, "video.pix_fmt": context.pix_fmt}


class Statistics:
    """Statistics of all columns and cameras, of each episode and of all of them together."""

    def __init__(self) -> None:
        self._columns: dict[str, list[np.ndarray]] = {}
        self._histograms: dict[str, tuple[np.ndarray, int]] = {}

    def add(self, columns: dict[str, np.ndarray], histograms: dict[str, tuple[np.ndarray, int]]) -> dict[str, dict[str, np.ndarray]]:
        """The statistics of an episode with these columns and histograms of images."""
        for name, values in columns.items():
            self._columns.setdefault(name, []).append(values)
        for name, (counts, images) in histograms.items():
            before = self._histograms.get(name, (0, 0))
            self._histograms[name] = before[0] + counts, before[1] + images
        return _statistics_of(columns, histograms)

    def all(self) -> dict[str, dict[str, np.ndarray]]:
        return _statistics_of({name: np.concatenate(parts) for name, parts in self._columns.items()}, self._histograms)


def _statistics_of(columns: dict[str, np.ndarray], histograms: dict[str, tuple[np.ndarray, int]]) -> dict[str, dict[str, np.ndarray]]:
    result = {name: statistics.of_rows(values) for name, values in columns.items()}
    for name, (counts, images) in histograms.items():
        result[name] = statistics.of_histograms(counts, images, statistics.LEVELS if len(counts) == 3 else lerobot_depth.LEVELS)
    return result


class _Tables:
    """Parquet files of at most about 100 MB."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tables: list[Any] = []
        self._bytes = 0
        self._file = 0

    @property
    def place(self) -> dict[str, int]:
        """The file that the next table is written to."""
        if self._bytes > DATA_FILE_MB * 1e6:
            self.flush()
        return _place(self._file)

    def add(self, table: Any) -> None:
        self._tables.append(table)
        self._bytes += table.nbytes

    def flush(self) -> None:
        if self._tables:
            path = self._folder / (_PLACE.format(**_place(self._file)) + ".parquet")
            path.parent.mkdir(parents=True, exist_ok=True)
            needs("pyarrow.parquet").write_table(needs("pyarrow").concat_tables(self._tables), path)
            self._tables, self._bytes = [], 0
            self._file += 1


class _Videos:
    """MP4 files of one camera of at most about 200 MB."""

    def __init__(self, folder: Path, fps: Fraction) -> None:
        self._folder, self._fps = folder, fps
        self._file = 0
        self._video = self._new()

    def add(self, path: Path, length: int) -> tuple[dict[str, int], float]:
        """Appends a video of ``length + 1`` frames, the last of which is not used. Returns its file and the time of its first frame there."""
        first = self._video.frames
        full = first and self._video.bytes + path.stat().st_size > VIDEO_FILE_MB * 1e6
        if full or not self._found_by_time(length) or not self._video.add(path, length + 1):
            self.close()
            self._file += 1
            self._video = self._new()
            first = 0
            self._video.add(path, length + 1)
        return _place(self._file), float(times(1, self._fps, first)[0])

    def close(self) -> None:
        self._video.close()

    def _new(self) -> Concatenation:
        return Concatenation(self._folder / (_PLACE.format(**_place(self._file)) + ".mp4"), self._fps)

    def _found_by_time(self, length: int) -> bool:
        """Whether LeRobot's reader finds every frame. It adds times of 32 bits to the time of the first frame and compares the sum, in 32 bits,
        with the time of the frame: late in a long file, a sum that is rounded to the other side differs by more than the tolerance."""
        exact = times(length, self._fps, self._video.frames)
        added = exact[0] + times(length, self._fps).astype(np.float32).astype(np.float64)
        return bool((np.abs(added.astype(np.float32) - exact.astype(np.float32)) < _TOLERANCE_S).all())


def _place(file: int) -> dict[str, int]:
    return {"chunk_index": file // FILES_PER_CHUNK, "file_index": file % FILES_PER_CHUNK}


class Writer:
    """A data set that is being written."""

    def __init__(self, source: Source, path: Path, statistics_frames: int | Literal["key"], histograms: Histograms = frame_histograms) -> None:
        self._source, self._path, self._histograms = source, path, histograms
        self._tasks: list[str] = []
        self._data, self._episodes = _Tables(path / "data"), _Tables(path / "meta/episodes")
        self._videos = {camera: _Videos(path / "videos" / image_key(camera), source.fps) for camera in source.cameras}
        self._statistics = Statistics()
        self._statistics_frames: int | Literal["key"] = statistics_frames
        self._count = self._frames = 0
        self._codec: dict[str, Any] = {}

    def add(self, episode: Episode, source: Source | None = None) -> None:
        """Appends an episode.

        Args:
            source: The recording that contains it, if it is not the writer's own; its features must be the same.
        """
        self._source = source or self._source
        pa = needs("pyarrow")
        if episode.task not in self._tasks:
            self._tasks.append(episode.task)
        columns = columns_of(self._source, episode, self._count, self._frames, self._tasks.index(episode.task))
        length = episode.length - 1
        entry: dict[str, Any] = {"episode_index": self._count, "tasks": [episode.task], "length": length}
        entry |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + length}
        entry |= {f"data/{name}": value for name, value in self._data.place.items()}
        self._data.add(table_of(columns))
        histograms: dict[str, tuple[np.ndarray, int]] = {}
        for camera, videos in self._videos.items():
            key = image_key(camera)
            if is_depth(self._source, camera):
                place, first, histograms[key] = self._add_depth(episode, camera, videos)
            else:
                with video_file(self._source.video(episode, camera), self._path) as path:
                    self._codec = self._codec or codec_of(path)
                    place, first = videos.add(path, length)
                    histograms[key] = self._histograms(path, length, self._statistics_frames)
            entry |= {f"videos/{key}/{name}": value for name, value in place.items()}
            entry |= {f"videos/{key}/from_timestamp": first, f"videos/{key}/to_timestamp": first + length / float(self._source.fps)}
        for name, found in self._statistics.add(columns, histograms).items():
            entry |= {f"stats/{name}/{key}": value for key, value in lists(found).items()}
        entry |= {f"meta/episodes/{name}": value for name, value in self._episodes.place.items()}
        self._episodes.add(pa.Table.from_pylist([entry]))
        self._count += 1
        self._frames += length

    def _add_depth(self, episode: Episode, camera: str, videos: _Videos) -> tuple[dict[str, int], float, tuple[np.ndarray, int]]:
        """Encodes a depth video as LeRobot expects it, and copies the exact one to ``extras`` unless the episode is trimmed."""
        video = self._source.video(episode, camera)
        if not video.trimmed:
            exact = self._path / f"extras/depth/{camera}/episode_{self._count:06d}{video.path.suffix}"
            exact.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(video.path, exact)
        encoded = self._path / "depth.mp4"
        histogram = lerobot_depth.encode_depth(video, encoded, self._source.fps, episode.length - 1)
        place, first = videos.add(encoded, episode.length - 1)
        encoded.unlink()
        return place, first, histogram

    def close(self) -> None:
        self._data.flush()
        self._episodes.flush()
        for videos in self._videos.values():
            videos.close()
        _write_tasks(self._path / "meta/tasks.parquet", self._tasks)
        write_json(self._path / "meta/stats.json", {name: lists(found) for name, found in self._statistics.all().items()})
        info = {
            "codebase_version": "v3.0", "robot_type": self._source.robot or None, "total_episodes": self._count, "total_frames": self._frames,
            "total_tasks": len(self._tasks), "chunks_size": FILES_PER_CHUNK, "data_files_size_in_mb": DATA_FILE_MB,
            "video_files_size_in_mb": VIDEO_FILE_MB, "fps": number(self._source.fps), "splits": {"train": f"0:{self._count}"},
            "data_path": f"data/{_PLACE}.parquet", "video_path": f"videos/{{video_key}}/{_PLACE}.mp4" if self._videos else None,
            "features": features_of(self._source, self._codec),
        }  # fmt: skip
        write_json(self._path / "meta/info.json", info)


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """LeRobot reads this table with pandas and expects the instructions as its index."""
    pa = needs("pyarrow")
    column = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    index = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    about = {"index_columns": ["task"], "column_indexes": [], "columns": [index, column], "pandas_version": "2.0.0"}
    table = pa.table({"task_index": list(range(len(tasks))), "task": tasks}).replace_schema_metadata({"pandas": json.dumps(about)})
    path.parent.mkdir(parents=True, exist_ok=True)
    needs("pyarrow.parquet").write_table(table, path)


def _dtype(dtype: np.dtype[Any]) -> str:
    return "bool" if dtype.kind == "b" else "int64" if dtype.kind in "iu" else "float32"


def _stored_size(shape: tuple[int, ...]) -> tuple[int, int]:
    """Height and width of the stored frames: colour images of odd sizes have one more row or column."""
    _, height, width, *colour = shape
    return (height + height % 2, width + width % 2) if colour else (height, width)
