# SPDX-License-Identifier: Apache-2.0
"""Export to the Zarr layout of Diffusion Policy's replay buffer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense._arguments import checked
from mjsense.export.images import depth_videos
from mjsense.export.mapping import Source
from mjsense.export.output import needs, new_output

if TYPE_CHECKING:
    from mjsense.export.mapping import Mapping

_ROWS = 4096  # rows of a chunk of numbers
_CHUNK_BYTES = 2_000_000  # of a chunk of images, as Diffusion Policy's own


@checked
def export_zarr(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a Zarr 2 folder: arrays of all steps of all episodes in ``data``, and ``meta/episode_ends``, as Diffusion
    Policy's ``ReplayBuffer`` reads them. Images are decoded.

    Args:
        root: Recording: its folder, one of its ``house_N`` folders, or one HDF5 file.
        out: Folder to write. It must not exist.
        map: Which streams become which arrays: a TOML file, a dict of the same form, or a Mapping.
        episodes: Positions of episodes in the recording; by default all.
        success: Only successful (True) or only failed (False) episodes.
        trim_idle: Leave out the steps in which nothing moves (:meth:`mjsense.Episode.trimmed`).
        progress: Called with the number of written episodes and of all episodes.

    Returns:
        ``out``.
    """
    zarr = needs("zarr", "zarr")
    if not zarr.__version__.startswith("2."):
        raise RuntimeError(f"Export to Zarr needs zarr 2, which Diffusion Policy reads; installed is {zarr.__version__}: pip install 'mjsense[zarr]'")
    source = Source(root, map=map, episodes=episodes, success=success, trim_idle=trim_idle)
    ends = np.cumsum([episode.length - 1 for episode in source.episodes], dtype=np.int64)
    steps = int(ends[-1]) if len(ends) else 0
    with new_output(out) as path:
        group = zarr.open_group(str(path), mode="w")
        data = group.create_group("data")
        arrays = {name: data.create_dataset(name, shape=(steps, feature.size), chunks=(_ROWS, feature.size), dtype=feature.dtype)
                  for name, feature in source.features.items()}  # fmt: skip
        for i, episode in enumerate(source.episodes):
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
            if progress is not None:
                progress(i + 1, len(source))
        group.create_group("meta").array("episode_ends", ends, chunks=_ROWS)
        group.attrs.update(_attributes(source))
    return Path(out)


def _attributes(source: Source) -> dict[str, Any]:
    return {
        "fps": float(source.fps),
        "robot": source.robot,
        "names": {name: list(feature.names) for name, feature in source.features.items()},
        "episodes": [{"task": e.task, "outcome": e.outcome, "seed": e.seed} for e in source.episodes],
    }
