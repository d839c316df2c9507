# SPDX-License-Identifier: Apache-2.0
"""Images of an episode as exports write them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.errors import UnknownNameError
from mjsense.dataset import Episode, Video
from mjsense.exporting.mapping import Source
from mjsense.exporting.output import needs
from mjsense.exporting.remux import ends_with_last_frame

CRF = 18
"""Quality of videos that are encoded again, better than the recording's own."""
# As the recorder's, but for two options: crf, and mbtree, which in x264 165 with AVX-512 reads memory that was never written. In
# a program that has run for a while, the same images would become different files.
_OPTIONS = {"preset": "veryfast", "tune": "fastdecode", "crf": str(CRF), "bf": "0", "g": "20", "mbtree": "0"}
FLAGS = ("reward", "success", "terminated", "truncated")
"""Features that every export has."""


def depth_videos(source: Source, episode: Episode) -> dict[str, Video]:
    """Depth videos by the exported name of their camera, of the cameras that recorded depth."""
    found: dict[str, Video] = {}
    for exported, camera in source.cameras.items():
        try:
            found[exported] = episode.video(f"{camera}_depth")
        except UnknownNameError:
            continue
    return found


def depth_unit(video: Video) -> float:
    """Metres per unit of the integers that store a depth video."""
    return video._info.metres_per_unit or 0.0002  # MolmoSpaces' videos have another encoding


def to_uint16(depth: np.ndarray, unit: float) -> np.ndarray:
    """Depth in units instead of metres."""
    return np.clip(np.rint(depth / unit), 0, 65535).astype(np.uint16)


def padded(image: np.ndarray) -> Any:
    """A frame for an encoder of videos with an even width and height."""
    height, width = int(image.shape[0]), int(image.shape[1])
    return needs("av").VideoFrame.from_ndarray(
        np.pad(image, np.array([(0, height % 2), (0, width % 2), (0, 0)]), "edge"), format="rgb24"
    )


@contextlib.contextmanager
def video_file(video: Video, folder: Path) -> Iterator[tuple[Path, int]]:
    """The file of a colour video, of which the first ``len(video) - 1`` frames belong to steps, and its number of frames.

    The video of a trimmed episode, or one in which other frames need the last frame, is encoded again, without the last frame,
    into ``folder``, and deleted at the end of the block.
    """
    video.check()
    if not video.trimmed and ends_with_last_frame(video.path):
        yield video.path, len(video)
        return
    path = folder / "encoded.mp4"
    path.parent.mkdir(parents=True, exist_ok=True)
    with needs("av").open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=video.fps, options=_OPTIONS)
        height, width = video.shape[1:3]
        stream.width, stream.height, stream.pix_fmt = width + width % 2, height + height % 2, "yuv420p"
        for t in range(len(video) - 1):
            frame = padded(video[t])
            frame.pts = t
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    try:
        yield path, len(video) - 1
    finally:
        path.unlink()
