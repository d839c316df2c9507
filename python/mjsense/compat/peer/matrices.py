# SPDX-License-Identifier: Apache-2.0
"""4x4 matrices."""

import numpy as np

from mjsense import _core


def matrix_of_pose(pose: np.ndarray) -> np.ndarray:
    """4x4 of position and quaternion (wxyz)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.reshape(_core.quat_to_mat(pose[3:].tolist()), (3, 3)), pose[:3]
    return out


def matrix_of(pos: np.ndarray, mat: np.ndarray) -> np.ndarray:
    """4x4 of position and rotation matrix."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = mat.reshape(3, 3), pos
    return out


def pose_of_matrix(matrix: np.ndarray) -> list[float]:
    """Position and quaternion (wxyz) of a 4x4."""
    return [*matrix[:3, 3].tolist(), *_core.mat_to_quat(matrix[:3, :3].ravel().tolist())]
