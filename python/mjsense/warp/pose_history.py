# SPDX-License-Identifier: Apache-2.0
"""Poses of frames at the last times, for rays that are cast at different times of one reading (a lidar's sweep)."""

from __future__ import annotations

import warp as wp

from mjsense.warp.sensor import Worlds

wp.set_module_options({"enable_backward": False})


@wp.struct
class PoseHistory:
    """Rings of the last poses of each frame; ``capacity`` 0: none."""

    capacity: int
    time: wp.array3d(dtype=wp.float64)  # [B, F, capacity] s
    pos: wp.array3d(dtype=wp.vec3)
    quat: wp.array3d(dtype=wp.quat)
    newest: wp.array2d(dtype=int)  # [B, F]
    used: wp.array2d(dtype=int)  # [B, F]


@wp.struct
class Pose:
    pos: wp.vec3
    mat: wp.mat33


def make_history(worlds: Worlds, frames: int, capacity: int) -> PoseHistory:
    history, count = PoseHistory(), worlds.num_worlds if capacity else 0
    history.capacity = capacity
    history.time = worlds.zeros((count, frames, capacity), wp.float64)
    history.pos = worlds.zeros((count, frames, capacity), wp.vec3)
    history.quat = worlds.zeros((count, frames, capacity), wp.quat)
    history.newest, history.used = worlds.zeros((count, frames), int), worlds.zeros((count, frames), int)
    return history


@wp.func
def _back(history: PoseHistory, w: int, f: int, age: int) -> int:
    return (history.newest[w, f] - age + history.capacity) % history.capacity


@wp.func
def push(history: PoseHistory, w: int, f: int, time: wp.float64, pos: wp.vec3, mat: wp.mat33):
    """Adds the pose at this time. It replaces poses at the same time or later, which are measured again."""
    while history.used[w, f] > 0 and history.time[w, f, history.newest[w, f]] >= time:
        history.newest[w, f] = _back(history, w, f, 1)
        history.used[w, f] = history.used[w, f] - 1
    at = (history.newest[w, f] + 1) % history.capacity
    history.newest[w, f] = at
    history.used[w, f] = wp.min(history.used[w, f] + 1, history.capacity)
    history.time[w, f, at] = time
    history.pos[w, f, at] = pos
    history.quat[w, f, at] = wp.quat_from_matrix(mat)


@wp.func
def pose_at(history: PoseHistory, w: int, f: int, time: wp.float64) -> Pose:
    """The pose, interpolated along the shortest arc; before the first and after the last known time that pose."""
    after = history.newest[w, f]
    before = after
    s = float(0.0)
    for age in range(1, history.used[w, f]):
        if time < history.time[w, f, before]:
            after = before
            before = _back(history, w, f, age)
    if time > history.time[w, f, before] and after != before:
        span = history.time[w, f, after] - history.time[w, f, before]
        s = float((time - history.time[w, f, before]) / span)
    s = wp.clamp(s, 0.0, 1.0)
    begin = history.quat[w, f, before]
    end = history.quat[w, f, after]
    if wp.dot(begin, end) < 0.0:
        end = -end
    pose = Pose()
    pose.pos = history.pos[w, f, before] + s * (history.pos[w, f, after] - history.pos[w, f, before])
    pose.mat = wp.quat_to_matrix(wp.normalize(wp.quat_slerp(begin, end, s)))
    return pose


@wp.kernel
def _clear(mask: wp.array(dtype=bool), history: PoseHistory):
    w, f = wp.tid()
    if mask[w]:
        history.used[w, f] = 0


def clear(history: PoseHistory, mask: wp.array) -> None:
    """Forgets the poses of the worlds of the mask."""
    wp.launch(_clear, dim=history.used.shape, inputs=[mask, history], device=mask.device)
