# SPDX-License-Identifier: Apache-2.0
"""Images of an episode as exports write them."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from mjsense.dataset import Episode, Video
from mjsense.errors import UnknownNameError
from mjsense.export.mapping import Source

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


def png(image: np.ndarray) -> bytes:
    """A lossless PNG of uint8 [H, W, 3] or uint16 [H, W]."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image if image.dtype == np.uint8 else image.astype(">u2")).view(np.uint8).reshape(height, -1)
    pixel = rows.shape[1] // width
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = 1  # the filter "Sub": bytes minus those of the pixel to the left
    filtered[:, 1 : 1 + pixel] = rows[:, :pixel]
    filtered[:, 1 + pixel :] = rows[:, pixel:] - rows[:, :-pixel]

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8 * image.dtype.itemsize, 2 if image.ndim == 3 else 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(filtered.tobytes(), 1)) + chunk(b"IEND", b"")


def depth_unit(video: Video) -> float:
    """Metres per unit of the integers that store a depth video."""
    return video._info.metres_per_unit or 0.0002  # MolmoSpaces' videos have another encoding


def to_uint16(depth: np.ndarray, unit: float) -> np.ndarray:
    """Depth in units instead of metres."""
    return np.clip(np.rint(depth / unit), 0, 65535).astype(np.uint16)
