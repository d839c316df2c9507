# SPDX-License-Identifier: Apache-2.0
"""Streams that are poses, drawn as frames; and the first view of a scene."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mjsense.drawing import DebugShapes

POSE = "m, wxyz"
"""Unit of streams that are poses: position and quaternion."""
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
            shapes.add_frame(position, rotation, 1.5 * shapes.meansize, self.name, 0.04 * shapes.meansize)


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion wxyz."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip


_BESIDE_ROBOT = np.array([1.5, -1.2, 1.5]), np.array([0.4, 0, 0.6])  # m, in the frame of a robot's base: a view from its side, and what it looks at
View = tuple[np.ndarray, np.ndarray, float]
"""Position of a view, the point that it looks at, and its vertical field of view in rad."""


def first_view(model: Any, xpos: np.ndarray, xmat: np.ndarray) -> View:
    """From the side of the first robot of an episode; in other models MuJoCo's free camera."""
    names = [model.body(i).name for i in range(model.nbody)]
    base = next((i for i, name in enumerate(names) if name.startswith("robot_0/")), None)
    if base is None:
        return free_camera(model)
    position, target = (xpos[base] + xmat[base].reshape(3, 3) @ point for point in _BESIDE_ROBOT)
    return position, target, float(np.radians(45))


def free_camera(model: Any) -> View:
    """MuJoCo's free camera."""
    azimuth, elevation = np.radians([float(model.vis.global_.azimuth), float(model.vis.global_.elevation)])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    centre = np.array(model.stat.center)
    return centre - 1.5 * float(model.stat.extent) * forward, centre, float(np.radians(float(model.vis.global_.fovy)))
