# SPDX-License-Identifier: Apache-2.0
"""Streams that are poses, drawn as frames."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mjsense.core.rotations import rotation_of
from mjsense.sensors.drawing import DebugShapes

POSE = "m, wxyz"
"""Unit of streams that are poses: position and quaternion."""
_MIN_LENGTH = 0.12  # m, of the arrows of a frame
_BODY = "body "  # frame of poses relative to a body


class PoseStream(NamedTuple):
    """A stream of poses."""

    name: str
    frame: str

    @staticmethod
    def can_draw(frame: str) -> bool:
        """Whether the place of this frame in the world is known."""
        return frame == "world" or frame.startswith(_BODY)

    def draw(self, shapes: DebugShapes, values: np.ndarray, model: Any, xpos: np.ndarray, xmat: np.ndarray) -> None:
        """Adds a frame for each pose [..., 7]. Poses that are NaN or have no orientation are left out."""
        for pose in np.asarray(values, np.float64).reshape(-1, 7):
            if not np.isfinite(pose).all() or not pose[3:].any():
                continue
            position, rotation = pose[:3], rotation_of(pose[3:])
            if self.frame.startswith(_BODY):
                body = model.body(self.frame.removeprefix(_BODY)).id
                turn = xmat[body].reshape(3, 3)
                position, rotation = xpos[body] + turn @ position, turn @ rotation
            length = max(_MIN_LENGTH, 1.5 * shapes.meansize)
            shapes.add_frame(position, rotation, length, self.name, 0.04 * length)
