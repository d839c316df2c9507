# SPDX-License-Identifier: Apache-2.0
"""LeRobot v3.0: episodes concatenated in Parquet and MP4 files. The videos are copied, not encoded again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.dataset import Episode
from mjsense.exporting import lerobot_depth
from mjsense.exporting.frame_statistics import image_histograms
from mjsense.exporting.images import video_file
from mjsense.exporting.lerobot_files import (
    FILES_PER_CHUNK,
    Statistics,
    check_columns,
    codec_of,
    columns_of,
    features_of,
    image_key,
    in_folder,
    is_depth,
    number,
    print_rate,
    table_of,
    times,
    write_json,
)
from mjsense.exporting.mapping import Source, print_trimming
from mjsense.exporting.output import needs
from mjsense.exporting.remux import Concatenation

DATA_FILE_MB, VIDEO_FILE_MB = 100, 200
_TOLERANCE_S = 1e-4  # LeRobot's tolerance of times of frames
_PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes all episodes to the new folder ``path``."""
    print_rate(source)
    writer = Writer(source, path)
    for episode in source.each(progress):
        writer.add(episode)
    writer.close()


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
            path = in_folder(self._folder / (_PLACE.format(**_place(self._file)) + ".parquet"))
            needs("pyarrow.parquet").write_table(needs("pyarrow").concat_tables(self._tables), path)
            self._tables, self._bytes = [], 0
            self._file += 1


class _Videos:
    """MP4 files of one camera of at most about 200 MB."""

    def __init__(self, folder: Path, fps: Fraction) -> None:
        self._folder, self._fps = folder, fps
        self._file = 0
        self._video = self._new()

    def add(self, path: Path, fps: Fraction, frames: int, length: int) -> tuple[dict[str, int], float]:
        """Appends the first ``length`` frames of a video. Returns its file and the time of its first frame there.

        LeRobot's StreamingLeRobotDataset computes the time of a frame from the number of its row in the whole data set, so a file
        must not contain any other frame.

        Args:
            fps: Rate of the video.
            frames: Number of frames of the video.
        """
        first = self._video.frames
        full = first and self._video.bytes + path.stat().st_size > VIDEO_FILE_MB * 1e6
        if full or not self._found_by_time(length) or not self._video.add(path, fps, frames, length):
            self.close()
            self._file += 1
            self._video = self._new()
            first = 0
            self._video.add(path, fps, frames, length)
        return _place(self._file), float(times(1, self._fps, first)[0])

    def close(self) -> None:
        self._video.close()

    def _new(self) -> Concatenation:
        return Concatenation(self._folder / (_PLACE.format(**_place(self._file)) + ".mp4"), self._fps)

    def _found_by_time(self, length: int) -> bool:
        """Whether LeRobot's reader finds every frame. It adds times of 32 bits to the time of the first frame and compares the
        sum, in 32 bits, with the time of the frame: late in a long file, a sum that is rounded to the other side differs by more
        than the tolerance."""
        exact = times(length, self._fps, self._video.frames)
        added = exact[0] + times(length, self._fps).astype(np.float32).astype(np.float64)
        return bool((np.abs(added.astype(np.float32) - exact.astype(np.float32)) < _TOLERANCE_S).all())


def _place(file: int) -> dict[str, int]:
    return {"chunk_index": file // FILES_PER_CHUNK, "file_index": file % FILES_PER_CHUNK}


class Writer:
    """A data set that is being written."""

    LAST_FILE = "meta/info.json"
    """The file that is written last."""

    def __init__(self, source: Source, path: Path) -> None:
        check_columns(source)
        self._source, self._path = source, path
        self._tasks: list[str] = []
        self._data, self._episodes = _Tables(path / "data"), _Tables(path / "meta/episodes")
        self._videos = {camera: _Videos(path / "videos" / image_key(camera), source.fps) for camera in source.cameras}
        self._statistics = Statistics()
        self._count = self._frames = self._trimmed = 0
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
        # LeRobot warns of unknown keys in info.json, but not of columns.
        entry |= {"trimmed_steps": episode.trimmed_steps, "recorded_fps": float(self._source.recorded_fps)}
        entry |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + length}
        entry |= {f"data/{name}": value for name, value in self._data.place.items()}
        self._data.add(table_of(columns))
        histograms: dict[str, tuple[np.ndarray, int]] = {}
        for camera, videos in self._videos.items():
            key = image_key(camera)
            if is_depth(self._source, camera):
                place, first, histograms[key] = self._add_depth(episode, camera, videos)
            else:
                video = self._source.video(episode, camera)
                with video_file(video, self._path) as (path, frames):
                    self._codec = self._codec or codec_of(path)
                    place, first = videos.add(path, video.fps, frames, length)
                histograms[key] = image_histograms(episode, self._source.cameras[camera])
            entry |= {f"videos/{key}/{name}": value for name, value in place.items()}
            entry |= {
                f"videos/{key}/from_timestamp": first,
                f"videos/{key}/to_timestamp": first + length / float(self._source.fps),
            }
        for name, found in self._statistics.add(columns, histograms).items():
            entry |= {f"stats/{name}/{key}": value for key, value in found.items()}
        entry |= {f"meta/episodes/{name}": value for name, value in self._episodes.place.items()}
        self._episodes.add(pa.Table.from_pylist([entry]))
        self._count += 1
        self._frames += length
        self._trimmed += episode.trimmed_steps

    def print_notes(self) -> None:
        """Prints on stderr what the data set leaves out of the episodes, and whether its rate is another one."""
        print_trimming(self._trimmed, self._trimmed + self._frames)
        print_rate(self._source)

    def _add_depth(self, episode: Episode, camera: str, videos: _Videos) -> tuple[dict[str, int], float, tuple[np.ndarray, int]]:
        """Encodes a depth video as LeRobot expects it, and writes the exact one to ``extras``; MolmoSpaces' is exact only as a
        whole."""
        video = self._source.video(episode, camera)
        exact = self._path / f"extras/depth/{camera}/episode_{self._count:06d}{video.path.suffix}"
        if not video.trimmed:
            video.check()
            shutil.copyfile(video.path, in_folder(exact))
        elif video._info.encoding == "depth16":
            lerobot_depth.encode_exactly(video, in_folder(exact))  # without the frames that are left out
        encoded = self._path / "depth.mp4"
        length = episode.length - 1
        histogram = lerobot_depth.encode_depth(video, encoded, self._source.fps, length)
        place, first = videos.add(encoded, self._source.fps, length, length)
        encoded.unlink()
        return place, first, histogram

    def close(self) -> None:
        self._data.flush()
        self._episodes.flush()
        for videos in self._videos.values():
            videos.close()
        _write_tasks(self._path / "meta/tasks.parquet", self._tasks)
        write_json(self._path / "meta/stats.json", self._statistics.all())
        info = {
            "codebase_version": "v3.0",
            "robot_type": self._source.robot or None,
            "total_episodes": self._count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": DATA_FILE_MB,
            "video_files_size_in_mb": VIDEO_FILE_MB,
            "fps": number(self._source.fps),
            "splits": {"train": f"0:{self._count}"},
            "data_path": f"data/{_PLACE}.parquet",
            "video_path": f"videos/{{video_key}}/{_PLACE}.mp4" if self._videos else None,
            "features": features_of(self._source, self._codec),
        }
        write_json(self._path / self.LAST_FILE, info)


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """LeRobot reads this table with pandas and expects the instructions as its index."""
    pa = needs("pyarrow")
    column = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    index = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    about = {"index_columns": ["task"], "column_indexes": [], "columns": [index, column], "pandas_version": "2.0.0"}
    table = pa.table({"task_index": list(range(len(tasks))), "task": tasks}).replace_schema_metadata(
        {"pandas": json.dumps(about)}
    )
    needs("pyarrow.parquet").write_table(table, in_folder(path))
