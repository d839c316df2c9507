# SPDX-License-Identifier: Apache-2.0
"""Images of an episode as exports write them."""

from __future__ import annotations

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


def depth_unit(video: Video) -> float:
    """Metres per unit of the integers that store a depth video."""
    return video._info.metres_per_unit or 0.0002  # MolmoSpaces' videos have another encoding


def to_uint16(depth: np.ndarray, unit: float) -> np.ndarray:
    """Depth in units instead of metres."""
    return np.clip(np.rint(depth / unit), 0, 65535).astype(np.uint16)
