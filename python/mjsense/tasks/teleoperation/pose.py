# SPDX-License-Identifier: Apache-2.0
"""Poses of the tool and the base."""

from __future__ import annotations

import numpy as np

from mjsense.core.rotations import inverse, product, rotation_by, rotation_of


class Pose:
    """Position [3] m, and orientation [4] wxyz."""

    def __init__(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        self.position, self.quaternion = np.array(position, np.float64), np.array(quaternion, np.float64)

    @staticmethod
    def of_row(row: np.ndarray) -> Pose:
        """Of x, y, z, w, x, y, z."""
        return Pose(row[:3], row[3:7])

    @property
    def row(self) -> np.ndarray:
        return np.concatenate([self.position, self.quaternion])

    def seen_from(self, base: Pose) -> Pose:
        """This pose in the frame ``base``; both are in the same frame."""
        turn = inverse(base.quaternion)
        return Pose(rotation_of(turn) @ (self.position - base.position), product(turn, self.quaternion))

    def carried_by(self, base: Pose) -> Pose:
        """The inverse of ``seen_from``."""
        return Pose(base.position + rotation_of(base.quaternion) @ self.position, product(base.quaternion, self.quaternion))

    def moved(self, translation: np.ndarray, rotation: np.ndarray) -> Pose:
        """Displaced by a translation (m) and a rotation vector (rad) in the axes of its frame; the rotation is about its own
        origin."""
        return Pose(self.position + translation, product(rotation_by(rotation), self.quaternion))
