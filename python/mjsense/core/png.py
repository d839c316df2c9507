# SPDX-License-Identifier: Apache-2.0
"""Lossless PNG images."""

from __future__ import annotations

import struct
import zlib

import numpy as np


def png_of(image: np.ndarray) -> bytes:
    """A PNG of uint8 [H, W, 3] or uint16 [H, W]."""
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
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(filtered.tobytes(), 1)) + chunk(b"IEND", b"")
    )
