# SPDX-License-Identifier: Apache-2.0
"""Depth videos as LeRobot 0.6 stores them: a logarithm of the distance in 12 bits, HEVC without loss."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.dataset import Video
from mjsense.exporting.images import depth_unit, to_uint16
from mjsense.exporting.output import needs

_NEAR_M, _FAR_M, _SHIFT_M = 0.01, 10.0, 3.5  # LeRobot's defaults
_LARGEST = 4095
_LOG_NEAR, _LOG_RANGE = np.log(_NEAR_M + _SHIFT_M), np.log((_FAR_M + _SHIFT_M) / (_NEAR_M + _SHIFT_M))
LEVELS = np.exp(_LOG_NEAR + np.arange(_LARGEST + 1) / _LARGEST * _LOG_RANGE) - _SHIFT_M
"""Distances of the codes. [m]"""
INFO = {
    "is_depth_map": True,
    "depth_unit": "m",
    "video.depth_min": _NEAR_M,
    "video.depth_max": _FAR_M,
    "video.shift": _SHIFT_M,
    "video.use_log": True,
    "video.channels": 1,
    "video.codec": "hevc",
    "video.pix_fmt": "gray12le",
}
"""Entries of a feature's ``info`` in ``meta/info.json``."""
# Two frames between key frames, as LeRobot's own videos; x265 prints its settings otherwise.
_X265 = "lossless=1:bframes=0:keyint=2:log-level=none"


def codes_of(depth: np.ndarray) -> np.ndarray:
    """uint16 codes of distances in metres. 0, which means no measurement, and everything nearer than 0.01 m have the code 0."""
    scaled = (np.log(depth + np.float32(_SHIFT_M)) - _LOG_NEAR) * (_LARGEST / _LOG_RANGE)
    return np.rint(scaled).clip(0, _LARGEST).astype(np.uint16)


def encode_exactly(video: Video, path: Path) -> None:
    """Encodes a depth video without loss to the Matroska file ``path``, as the recorder does."""
    av: Any = needs("av")
    _, height, width = video.shape
    with av.open(str(path), "w", format="matroska") as file:
        stream = file.add_stream("ffv1", rate=video.fps, options={"level": "3", "g": "1", "slicecrc": "1"})
        stream.width, stream.height, stream.pix_fmt = width, height, "gray16le"
        for t in range(len(video)):
            frame = av.VideoFrame.from_ndarray(to_uint16(video[t], depth_unit(video)), format="gray16le")
            frame.pts = t
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


def encode_depth(video: Video, path: Path, fps: Fraction, length: int) -> tuple[np.ndarray, int]:
    """Encodes the first ``length`` frames of a depth video to the MP4 file ``path``.

    Returns:
        Histogram int64 [1, 4096] of their codes, and ``length``.
    """
    av: Any = needs("av")
    counts = np.zeros((1, _LARGEST + 1), np.int64)
    _, height, width = video.shape
    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx265", rate=fps, options={"x265-params": _X265})
        stream.width, stream.height, stream.pix_fmt = width, height, "gray12le"
        for t in range(length):
            codes = codes_of(video[t])
            counts[0] += np.bincount(codes.ravel(), minlength=_LARGEST + 1)
            frame = av.VideoFrame.from_ndarray(codes, format="gray12le")
            frame.pts = t
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    return counts, length
