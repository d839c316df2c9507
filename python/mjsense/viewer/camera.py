# SPDX-License-Identifier: Apache-2.0
"""The first view of a scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.core import mujoco_names
from mjsense.core.rotations import rotation_of

View = tuple[np.ndarray, np.ndarray, float]
"""Position of a view, the point that it looks at, and its vertical field of view in rad."""

# From the side and above, in the robot's directions: x forward, z up. m
_AHEAD = np.array([0.2, 0.0, 0.0])  # from the middle of the robot to the point that is looked at
_OFFSET = np.array([1.0, -1.1, 0.75])  # from there to the eye, for a robot of 0.6 m around its middle
_TURNS = np.radians([0, 90, -50, 140, 180, -120])  # about the target, if something is in the way
_NEARER = (1.0, 0.7, 0.45)
_MIN_SCALE, _MAX_SCALE = 0.5, 4.0
_FOV = float(np.radians(45))


def first_view(model: Any, xpos: np.ndarray, xmat: np.ndarray) -> View:
    """From the side of the first robot of an episode, in other models of the largest mechanism, where no wall is in the way.
    Models without joints are shown by MuJoCo's free camera.

    Args:
        xpos: Positions of the bodies. [m]
        xmat: Rotation matrices of the bodies.
    """
    robot = [i for i in range(model.nbody) if model.body(i).name.startswith("robot_0/")] or _largest_mechanism(model)
    if not robot:
        return free_view(model)
    base = next((i for i in robot if model.body_geomnum[i] > 0), robot[0])  # mobile robots have bodies without geoms before it
    forward = xmat[base].reshape(3, 3)[:2, 0]
    yaw = float(np.arctan2(forward[1], forward[0]))
    middle = xpos[robot].mean(0)
    size = float(np.linalg.norm(xpos[robot] - middle, axis=1).max())
    target = middle + _turned(_AHEAD, yaw)
    centres, turns, halves = _boxes(model, xpos, xmat, set(robot), target)
    best, best_free = _OFFSET, -1.0
    for scale in _NEARER:
        for turn in _TURNS:
            offset = scale * min(max(0.4 + size, _MIN_SCALE), _MAX_SCALE) * _turned(_OFFSET, yaw + turn)
            free = _free(target, offset, centres, turns, halves)
            if free >= 1:
                return target + offset, target, _FOV
            if free * scale > best_free:
                best, best_free = 0.9 * free * offset, free * scale
    return target + best, target, _FOV


def _largest_mechanism(model: Any) -> list[int]:
    """The bodies of the kinematic tree with the most degrees of freedom."""
    if model.nv == 0:
        return []
    roots, counts = np.unique(np.asarray(model.body_rootid)[model.dof_bodyid], return_counts=True)
    return np.flatnonzero(np.asarray(model.body_rootid) == roots[counts.argmax()]).tolist()


def _turned(point: np.ndarray, yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1], point[2]])


def _boxes(
    model: Any, xpos: np.ndarray, xmat: np.ndarray, skipped: set[int], target: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounding boxes of the geoms that can be in the way: centres, rotations and half sides."""
    centres, turns, halves = [np.zeros((0, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if int(model.geom_type[geom]) == mujoco_names.Geom.PLANE or body in skipped or model.geom_rgba[geom, 3] == 0:
            continue
        turn = xmat[body].reshape(3, 3)
        own = turn @ rotation_of(model.geom_quat[geom])
        centre = xpos[body] + turn @ model.geom_pos[geom] + own @ model.geom_aabb[geom, :3]
        if (np.abs(own.T @ (target - centre)) < model.geom_aabb[geom, 3:]).all():
            continue  # the target is inside
        centres.append(centre[None])
        turns.append(own[None])
        halves.append(model.geom_aabb[geom, 3:][None])
    return np.concatenate(centres), np.concatenate(turns), np.concatenate(halves)


def _free(start: np.ndarray, offset: np.ndarray, centres: np.ndarray, turns: np.ndarray, halves: np.ndarray) -> float:
    """Fraction of the way from a point to another that is outside of all boxes; 1: all of it."""
    origin = np.einsum("nji,nj->ni", turns, start - centres)
    direction = np.einsum("nji,j->ni", turns, offset)
    direction = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    a, b = (-halves - origin) / direction, (halves - origin) / direction
    enter, leave = np.minimum(a, b).max(1), np.maximum(a, b).min(1)
    hits = enter[(enter <= leave) & (leave > 0) & (enter > 0) & (enter < 1.05)]
    return float(hits.min()) if len(hits) else 1.0


def free_view(model: Any) -> View:
    """The view of MuJoCo's free camera."""
    position, _ = mujoco_names.free_camera(model)
    return position, np.array(model.stat.center), float(np.radians(float(model.vis.global_.fovy)))
