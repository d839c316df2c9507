# SPDX-License-Identifier: Apache-2.0
"""What the versions of LeRobot's format share: names, features, columns, statistics, and JSON files."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.dataset import Episode, statistics
from mjsense.dataset.video_decoder import CODECS, open_container
from mjsense.exporting import lerobot_depth
from mjsense.exporting.mapping import Feature, Source, check_names
from mjsense.exporting.output import needs

FILES_PER_CHUNK = 1000
_WHOLE_RATE = "With --policy-dt 50 (policy_dt_ms=50), `mjsense record` records 20 per second"
_INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")


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


def print_rate(source: Source) -> None:
    """Prints on stderr that the rate is not a whole number."""
    exact, longer = float(source.recorded_fps), float(source.recorded_fps / source.fps) - 1
    if source.fps != source.recorded_fps:
        print(
            f"{exact:.6g} rows per second are written as {source.fps}, because LeRobot's rates are whole numbers: "
            f"times are {abs(longer):.1%} "
            f"{'longer' if longer > 0 else 'shorter'}; --exact-rate (exact_rate=True) keeps the rate. {_WHOLE_RATE}",
            file=sys.stderr,
        )
    elif source.fps.denominator != 1:
        print(
            f"{exact:.6g} rows per second are not a whole number: LeRobot reads the data set, but cannot delete, "
            "split or append episodes. "
            f"{_WHOLE_RATE}",
            file=sys.stderr,
        )


def check_columns(source: Source, more: Iterable[str] = ()) -> None:
    """Raises ValueError if two columns would have the same name.

    Args:
        more: Further columns of the format.
    """
    own = ("next.done", *_INDICES, "task", *more)
    names = [
        *((name, f"LeRobot's column '{name}'") for name in own),
        *((key_of(feature), f"the feature '{feature.name}'") for feature in exported(source)),
    ]
    check_names([*names, *((image_key(camera), f"the camera '{camera}'") for camera in source.cameras)])


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
    for name in _INDICES[1:]:
        found[name] = {"dtype": "int64", "shape": [1], "names": None}
    return found


def columns_of(source: Source, episode: Episode, position: int, first_index: int, task_index: int) -> dict[str, np.ndarray]:
    """Columns of an episode: ``[T - 1, size]``, and ``[T - 1]`` of single numbers. The last observation has no action and is left
    out."""
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


def in_folder(path: Path) -> Path:
    """The path, after its folder was made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def write_json(path: Path, value: Any) -> None:
    in_folder(path).write_text(json.dumps(value, indent=4, ensure_ascii=False))


def codec_of(path: Path) -> dict[str, Any]:
    """The entries of a feature's ``info`` that name the codec of a video."""
    with open_container(path, codecs=f"{CODECS},hevc") as video:
        context = video.streams.video[0].codec_context
        return {"video.codec": context.codec.canonical_name, "video.pix_fmt": context.pix_fmt}


class Statistics:
    """Statistics of all columns and cameras, of each episode and of all of them together, as JSON and Arrow take them: lists by
    the name of the column or image and by that of the statistic."""

    def __init__(self) -> None:
        self._columns: dict[str, list[np.ndarray]] = {}
        self._histograms: dict[str, tuple[np.ndarray, int]] = {}

    def add(
        self, columns: dict[str, np.ndarray], histograms: dict[str, tuple[np.ndarray, int]]
    ) -> dict[str, dict[str, list[Any]]]:
        """The statistics of an episode with these columns and histograms of images."""
        for name, values in columns.items():
            self._columns.setdefault(name, []).append(values)
        for name, (counts, images) in histograms.items():
            before = self._histograms.get(name, (0, 0))
            self._histograms[name] = before[0] + counts, before[1] + images
        return _statistics_of(columns, histograms)

    def all(self) -> dict[str, dict[str, list[Any]]]:
        return _statistics_of({name: np.concatenate(parts) for name, parts in self._columns.items()}, self._histograms)


def _statistics_of(
    columns: dict[str, np.ndarray], histograms: dict[str, tuple[np.ndarray, int]]
) -> dict[str, dict[str, list[Any]]]:
    found = {name: statistics.of_rows(values) for name, values in columns.items()}
    for name, (counts, images) in histograms.items():
        found[name] = statistics.of_histograms(counts, images, statistics.LEVELS if len(counts) == 3 else lerobot_depth.LEVELS)
    return {name: {statistic: values.tolist() for statistic, values in stats.items()} for name, stats in found.items()}


def _dtype(dtype: np.dtype[Any]) -> str:
    return "bool" if dtype.kind == "b" else "int64" if dtype.kind in "iu" else "float32"


def _stored_size(shape: tuple[int, ...]) -> tuple[int, int]:
    """Height and width of the stored frames: colour images of odd sizes have one more row or column."""
    _, height, width, *colour = shape
    return (height + height % 2, width + width % 2) if colour else (height, width)
