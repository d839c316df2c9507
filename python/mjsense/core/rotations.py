# SPDX-License-Identifier: Apache-2.0
"""Quaternions wxyz as float64 arrays [4], and rotation matrices [3, 3]."""

from __future__ import annotations

import numpy as np


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion of any length."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternions_of(rotations: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4], w not negative, of rotation matrices [..., 3, 3]."""
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(rotations, (-2, -1), (0, 1))
    matrix = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    # Bar-Itzhack: xyzw is the eigenvector of the largest eigenvalue of a symmetric matrix. It has no special cases.
    vectors = np.linalg.eigh(np.moveaxis(matrix, (0, 1), (-2, -1)))[1]
    quaternions = vectors[..., [3, 0, 1, 2], 3]
    return quaternions * np.where(quaternions[..., :1] < 0, -1, 1)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation b followed by a, normalised."""
    aw, av, bw, bv = a[0], a[1:], b[0], b[1:]
    q = np.concatenate([[aw * bw - av @ bv], aw * bv + bw * av + np.cross(av, bv)])
    return q / np.linalg.norm(q)


def inverse(q: np.ndarray) -> np.ndarray:
    """Inverse of a quaternion of length 1."""
    return q * [1, -1, -1, -1]


def rotation_by(vector: np.ndarray) -> np.ndarray:
    """The rotation about this vector by its length, rad."""
    angle = float(np.linalg.norm(vector))
    return np.concatenate([[np.cos(angle / 2)], np.sinc(angle / (2 * np.pi)) / 2 * vector])
