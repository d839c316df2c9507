# SPDX-License-Identifier: Apache-2.0
"""Export to the Zarr layout of Diffusion Policy's replay buffer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.exporting.images import depth_videos
from mjsense.exporting.mapping import Source, check_names, named_streams
from mjsense.exporting.output import needs

_ROWS = 4096  # rows of a chunk of numbers
_CHUNK_BYTES = 2_000_000  # of a chunk of images, as Diffusion Policy's own


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes all episodes to the new folder ``path``. Of a part of a recording, the rows of the episodes before are missing."""
    check_names(named_streams(source, source.features))
    group = _zarr().open_group(str(path), mode="w")
    data = group.create_group("data")
    ends = _ends(source)
    steps = int(ends[-1])
    arrays = {
        name: data.create_dataset(name, shape=(steps, feature.size), chunks=(_ROWS, feature.size), dtype=feature.dtype)
        for name, feature in source.features.items()
    }
    for i, episode in enumerate(source.each(progress)):
        begin, end = int(ends[i]) - episode.length + 1, int(ends[i])
        for name, rows in source.rows(episode).items():
            arrays[name][begin:end] = rows[: end - begin]
        videos = {name: source.video(episode, name) for name in source.cameras}
        videos |= {f"{name}_depth": video for name, video in depth_videos(source, episode).items()}
        for name, video in videos.items():
            if name not in arrays:
                shape = video.shape[1:]
                frames = max(1, _CHUNK_BYTES // (int(np.prod(shape)) * video.dtype.itemsize))
                arrays[name] = data.create_dataset(name, shape=(steps, *shape), chunks=(frames, *shape), dtype=video.dtype)
            frames = arrays[name].chunks[0]
            for t in range(0, end - begin, frames):
                arrays[name][begin + t : min(begin + t + frames, end)] = video[t : min(t + frames, end - begin)]
    _finish(group, source)


def join(source: Source, parts: Iterable[Path], path: Path) -> None:
    """Writes the new folder ``path`` with the rows of several folders in their order. Chunks that lie in one part are moved; only
    those in which two parts meet are compressed again.

    Args:
        source: The episodes of all parts.
    """
    zarr = _zarr()
    steps = int(_ends(source)[-1])
    group = zarr.open_group(str(path), mode="w")
    data = group.create_group("data")
    begin = 0
    for part in parts:
        end = begin
        for name, array in zarr.open_group(str(part), mode="r")["data"].arrays():
            if name not in data:
                data.create_dataset(name, shape=(steps, *array.shape[1:]), chunks=array.chunks, dtype=array.dtype)
            rows, end = array.chunks[0], len(array)
            for number in range(begin // rows, -(-end // rows)):
                first, last = number * rows, min((number + 1) * rows, steps)
                if begin <= first and last <= end:
                    place = f"data/{name}/{number}{'.0' * (array.ndim - 1)}"
                    (part / place).rename(path / place)
                else:
                    met = slice(max(first, begin), min(last, end))
                    data[name][met] = array[met]
        begin = end
    _finish(group, source)


def _zarr() -> Any:
    zarr = needs("zarr", "zarr")
    if not zarr.__version__.startswith("2."):
        raise RuntimeError(
            f"Export to Zarr needs zarr 2, which Diffusion Policy reads; installed is {zarr.__version__}: pip "
            "install 'mjsense[zarr]'"
        )
    return zarr


def _ends(source: Source) -> np.ndarray:
    """Rows at which the episodes end."""
    return source.first_step + np.cumsum([episode.length - 1 for episode in source.episodes], dtype=np.int64)


def _finish(group: Any, source: Source) -> None:
    group.create_group("meta").array("episode_ends", _ends(source), chunks=_ROWS)
    group.attrs.update(_attributes(source))


def _attributes(source: Source) -> dict[str, Any]:
    return {
        "fps": float(source.fps),
        "robot": source.robot,
        "names": {name: list(feature.names) for name, feature in source.features.items()},
        "episodes": [
            {"task": e.task, "outcome": e.outcome, "seed": e.seed, "trimmed_steps": e.trimmed_steps} for e in source.episodes
        ],
    }
