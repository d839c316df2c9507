# SPDX-License-Identifier: Apache-2.0
"""Figures that describe how an episode was performed, from what its recording contains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mjsense.dataset.episode_rows import EpisodeRows

_SLOW = 0.03  # rad/s or m/s; slower joints do not move
_SMALL = 0.01  # smaller changes of a command, as a share of its largest value in the episode, are none
_DRIFT = 0.01  # rad or m; leaving out steps hides no larger motion
_POSE = (7,)
_POINTS = "obs/extra/object_image_points/"


@dataclass(frozen=True)
class EpisodeQuality:
    """Figures of one episode. A figure is NaN, or a dict is empty, if the recording lacks the streams that it needs."""

    idle: float
    """Share of the steps in which neither the joints nor the commands move."""
    longest_wait: float
    """Duration of the longest sequence of such steps. [s]"""
    jerk: float
    """Root mean square of the third derivative of the tool's position; of several tools the largest. [m/s^3]"""
    approach: float
    """Angle between vertical and the direction in which the gripper approaches the last planned grasp. [degrees]"""
    visibility: dict[str, dict[str, float]]
    """Share of the observations in which a camera shows an object, by camera and by the object's role in the task."""


def idle_steps(episode: EpisodeRows) -> np.ndarray:
    """Whether nothing moves in the step that led to an observation: bool ``[T]``; False for the first one."""
    moving = [name for name in episode.streams if name.startswith("obs/agent/qpos/")]
    commands = [name for name in episode.streams if name.startswith("actions/commanded_action/") and "/given/" not in name]
    if not moving or episode.length < 2:
        return np.zeros(episode.length, bool)
    still = np.ones(episode.length - 1, bool)
    limits = {name: _SLOW / float(episode.fps) for name in moving}
    rows = {name: episode[name].reshape(episode.length, -1).astype(float) for name in [*moving, *commands]}
    for name, values in rows.items():
        change = np.abs(np.diff(values, axis=0))
        change[0] = np.where(name in limits, change[0], 0)  # the first observation has no action
        still &= (change <= limits.get(name, _SMALL * np.abs(values).max())).all(1)
    return np.concatenate([[False], still])


def kept_rows(episode: EpisodeRows) -> list[int]:
    """Rows of the observations that :meth:`Episode.trimmed` leaves."""
    actors = [name for name in episode.streams if name.startswith("env_states/actors/")]
    joints = [name for name in episode.streams if name.startswith("obs/agent/qpos/")]
    # NaN: the object is absent.
    poses = [np.nan_to_num(episode[name].reshape(episode.length, -1)[:, :7].astype(float)) for name in actors]
    slow = _SLOW / float(episode.fps)
    still = idle_steps(episode)
    for pose in poses:
        still[1:] &= (np.abs(np.diff(pose, axis=0)) <= slow).all(1)
    moving = np.flatnonzero(~still)
    positions = (
        np.concatenate([*poses, *(episode[name].reshape(episode.length, -1) for name in joints)], 1)
        if joints
        else np.zeros((episode.length, 0))
    )
    kept = [0]
    for t in range(1, episode.length):
        if not still[t] or t > moving[-1] or np.abs(positions[t] - positions[kept[-1]]).max() > _DRIFT:
            kept.append(t)
    return kept


def quality_of(episode: EpisodeRows) -> EpisodeQuality:
    idle = idle_steps(episode)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], idle.astype(int), [0]])))
    waits = edges[1::2] - edges[::2]
    tools = [
        episode[name]
        for name, stream in episode.streams.items()
        if name.startswith("obs/extra/tcp_pose") and stream.shape == _POSE
    ]
    jerks = [np.diff(tool[:, :3].astype(float), 3, axis=0) * float(episode.fps) ** 3 for tool in tools if len(tool) > 3]
    visibility: dict[str, dict[str, float]] = {}
    for name in episode.streams:
        if name.startswith(_POINTS) and name.endswith("/num_points"):
            role, camera = name.removeprefix(_POINTS).split("/")[:2]
            visibility.setdefault(camera, {})[role] = float((episode[name] > 0).mean())
    return EpisodeQuality(
        idle=float(idle[1:].mean()) if episode.length > 1 else float("nan"),
        longest_wait=float(waits.max(initial=0) / episode.fps),
        jerk=max((float(np.sqrt((jerk**2).sum(1).mean())) for jerk in jerks), default=float("nan")),
        approach=_approach(episode),
        visibility=visibility,
    )


def _approach(episode: EpisodeRows) -> float:
    grasp = episode.streams.get("obs/extra/grasp_pose")
    if grasp is None or grasp.shape != _POSE or not episode.length:
        return float("nan")
    _, x, y, _ = episode["obs/extra/grasp_pose"][-1, 3:].astype(float)
    if not episode["obs/extra/grasp_pose"][-1, :3].any():
        return float("nan")  # no grasp was planned
    # The gripper approaches along its z axis, whose vertical component is 1 - 2 (x^2 + y^2).
    return float(np.degrees(np.arccos(np.clip(2 * (x * x + y * y) - 1, -1, 1))))
