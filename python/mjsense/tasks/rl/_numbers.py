# SPDX-License-Identifier: Apache-2.0
"""Shared by the adapters: observations as one row of numbers per world, and normalised actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from mjsense.sensors.nested_streams import choose_streams
from mjsense.tasks.vector import TaskVectorEnv


def checked_env(env: Any, who: str) -> TaskVectorEnv:
    """Raises TypeError or ValueError unless `env` is a vector environment with autoreset_mode "same_step"."""
    if not isinstance(env, TaskVectorEnv):
        raise TypeError(f"{who}: env must be what mjsense.make_vec() returns, not {env!r}")
    if env.autoreset_mode != AutoresetMode.SAME_STEP:
        raise ValueError(
            f"{who}: autoreset_mode is '{env.autoreset_mode.name.lower()}': make_vec(..., autoreset_mode='same_step') is needed"
        )
    return env


class Numbers:
    """Concatenates numeric streams to one row per world: float32 ``[B, n]``.

    Args:
        depth_images: Whether depth images are images, too, instead of numbers.
    """

    def __init__(self, env: TaskVectorEnv, observations: Sequence[str] | None = None, *, depth_images: bool = False) -> None:
        self._paths = env._paths
        streams = {name: (env._paths[name][0], env.specs[name], rows) for name, rows in env.rows.items()}
        chosen = list(streams) if observations is None else choose_streams(observations, streams)
        images = {name for name in chosen if is_image(env.specs[name]) or (depth_images and is_depth(env.specs[name]))}
        self.names = [name for name in chosen if name not in images]
        """Names of the streams, in the order of the columns."""
        self.images = [name for name in chosen if name in images]
        """Names of the streams that are images."""
        self.columns: dict[str, slice] = {}
        """Columns of each stream."""
        at = 0
        for name in self.names:
            width = int(np.prod(env.specs[name].shape, dtype=int))
            self.columns[name] = slice(at, at + width)
            at += width
        self.size = at
        """Number of columns, ``n``."""

    def box(self) -> gymnasium.spaces.Box:
        """Space of one world's row."""
        return gymnasium.spaces.Box(-np.inf, np.inf, (self.size,), np.float32)

    def of(self, observation: dict[str, Any], worlds: int) -> Any:
        """A new array with the rows of all worlds, ``[worlds, n]``; a tensor on the same device if the observations are
        tensors."""
        first: Any = stream_of(observation, self._paths[self.names[0]]) if self.names else None
        if hasattr(first, "detach"):
            rows = first.new_empty((worlds, self.size), dtype=first.float().dtype)
            for name, columns in self.columns.items():
                rows[:, columns] = stream_of(observation, self._paths[name]).reshape(worlds, -1)
            return rows
        out = np.empty((worlds, self.size), np.float32)
        for name, columns in self.columns.items():
            out[:, columns] = stream_of(observation, self._paths[name]).reshape(worlds, -1)
        return out


def is_image(spec: Any) -> bool:
    """Whether a world's row is uint8 ``[H, W, C]``."""
    return len(spec.shape) == 3 and spec.dtype == "uint8"


def is_depth(spec: Any) -> bool:
    """Whether a world's row is a depth image of a camera: float32 ``[H, W]``."""
    return len(spec.shape) == 2 and spec.dtype == "float32" and spec.frame.startswith("camera ")


def stream_of(observation: Any, path: Sequence[str]) -> Any:
    """A stream of a nested observation."""
    for key in path:
        observation = observation[key]
    return observation


class Actions:
    """Commands ``mean + scale * action``, clipped to the limits of the actuators: float64 ``[B, n]``, or tensors for tensors."""

    def __init__(self, space: gymnasium.spaces.Box, mean: Any, scale: Any) -> None:
        self.low, self.high = np.float64(space.low), np.float64(space.high)
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, -1.0), np.where(bounded, self.high, 1.0)
        self.mean = self._row("action_mean", (low + high) / 2 if mean is None else mean)
        self.scale = self._row("action_scale", (high - low) / 2 if scale is None else scale)

    def _row(self, name: str, value: Any) -> np.ndarray:
        try:
            return np.broadcast_to(np.asarray(value, np.float64), self.low.shape)
        except (TypeError, ValueError):
            raise ValueError(f"{name}: {value!r} is neither a number nor {self.low.size} numbers") from None

    def commands(self, actions: Any) -> Any:
        if hasattr(actions, "detach"):
            mean, scale, low, high = (actions.new_tensor(values) for values in (self.mean, self.scale, self.low, self.high))
            return (mean + scale * actions).clamp(low, high)
        return np.clip(self.mean + self.scale * actions, self.low, self.high)
