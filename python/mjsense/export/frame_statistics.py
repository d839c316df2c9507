# SPDX-License-Identifier: Apache-2.0
"""Histograms of the frames of a video, for statistics of images."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from mjsense.dataset import statistics
from mjsense.export.output import needs

DEFAULT_FRAMES: Literal["key"] = "key"
"""Frames that the statistics of images use."""
_LONG_SIDE = 160  # pixels; frames are sampled at every n-th row and column down to about this size
_PERIOD = 20  # frames from one key frame to the next, by default; with far fewer key frames, every 20th frame is used


def check_frames(frames: int | str) -> None:
    """Raises ValueError unless this is a number of frames, 0 for all, or ``key``."""
    if frames != "key" and (isinstance(frames, str) or frames < 0):
        raise ValueError(f"statistics_frames is {frames!r}: must be a number of frames of each episode, 0 for all, or 'key' for the key frames")


def frame_histograms(path: Path, length: int, frames: int | Literal["key"] = DEFAULT_FRAMES) -> tuple[np.ndarray, int]:
    """Histograms int64 [3, 256] of the channels of the first ``length`` frames, and the number of frames used.

    Args:
        frames: Maximum number of frames, evenly spaced; 0: all. All frames are decoded, up to the last one that is used. ``key``: the key
            frames, which need no others to be decoded; if a video has few of them, every 20th frame.
    """
    if frames == "key":
        found = _histograms(path, length, frames)
        return found if found[1] * 2 * _PERIOD >= length else _histograms(path, length, -(-length // _PERIOD))
    return _histograms(path, length, frames)


def _histograms(path: Path, length: int, frames: int | Literal["key"]) -> tuple[np.ndarray, int]:
    av = needs("av")
    chosen = range(length) if not frames or frames == "key" else np.unique(np.linspace(0, length - 1, min(frames, length)).astype(int))
    wanted = {int(n) for n in chosen}
    with av.open(str(path)) as video:
        stream = video.streams.video[0]
        stream.codec_context.options = {"skip_loop_filter": "all"}  # changes pixels at edges of blocks by a few levels, and is 20 % faster
        if frames == "key":
            stream.codec_context.skip_frame = "NONKEY"
        step = max(1, max(stream.width, stream.height) // _LONG_SIDE)
        width, height = max(1, stream.width // step), max(1, stream.height // step)

        per_tick = float(stream.time_base * stream.average_rate)

        def used():
            for frame in video.decode(stream):
                n = round(frame.pts * per_tick)
                if n in wanted:
                    yield frame.reformat(width, height, "rgb24", interpolation="POINT", threads=1).to_ndarray()
                if n >= length - 1:
                    return

        return statistics.histograms(used())
