# SPDX-License-Identifier: Apache-2.0
"""4x4 matrices."""

import mujoco
import numpy as np


def matrix_of_pose(pose: np.ndarray) -> np.ndarray:
    """4x4 of position and quaternion (wxyz)."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, pose[3:])
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.reshape(3, 3), pose[:3]
    return out


def matrix_of(pos: np.ndarray, mat: np.ndarray) -> np.ndarray:
    """4x4 of position and rotation matrix."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = mat.reshape(3, 3), pos
    return out


def pose_of_matrix(matrix: np.ndarray) -> list[float]:
    """Position and quaternion (wxyz) of a 4x4."""
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(matrix[:3, :3]).ravel())
    return [*matrix[:3, 3].tolist(), *quat.tolist()]
