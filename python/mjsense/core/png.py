# SPDX-License-Identifier: Apache-2.0
"""Lossless PNG images."""

from __future__ import annotations

import numpy as np

from mjsense import _core


def png_of(image: np.ndarray) -> bytes:
    """A PNG of uint8 ``[H, W, 3]`` or uint16 ``[H, W]``."""
    height, width, channels = (*image.shape, 1)[:3]
    pixels = image if image.dtype == np.uint8 else image.astype(">u2")
    return _core.encode_png(pixels.tobytes(), width, height, channels, 8 * pixels.itemsize)
