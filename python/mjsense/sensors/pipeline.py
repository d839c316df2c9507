# SPDX-License-Identifier: Apache-2.0
"""mjlab's observation pipeline for values that do not come from a sensor."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.arguments import KnownAttributes, Seed, checked
from mjsense.core.arrays import ids_of_worlds
from mjsense.core.old_names import old_argument
from mjsense.sensors import effects


class _Settings(SimpleNamespace):
    """The fields of the C++ pipeline's configuration."""


_Settings.__name__ = "ObservationPipeline"  # name in messages


@old_argument("num_envs", "num_worlds")
@checked
class ObservationPipeline(KnownAttributes):
    """Noise, bias, clip, scale, NaN policy, delay and history, in this order: call ``pipeline(values)`` with ``[B, D]`` once per
    control step.

    For sensors use :class:`mjsense.EffectSensorCfg`, which applies the same effects inside the simulation.
    """

    def __init__(
        self,
        num_worlds: int,
        *,
        enable_corruption: bool = True,
        bias: float | Sequence[float] | None = None,
        noise: effects.Gaussian | effects.Uniform | effects.Constant | float | None = None,
        operation: str = "add",
        episode_bias: effects.EpisodeBias | None = None,
        clip: Sequence[float] | None = None,
        scale: float | Sequence[float] | None = None,
        nan_policy: str = "disabled",
        delay_min_lag: int = 0,
        delay_max_lag: int = 0,
        delay_per_env: bool = True,
        delay_hold_prob: float = 0.0,
        delay_update_period: int = 0,
        delay_per_env_phase: bool = True,
        history_length: int = 0,
        flatten_history_dim: bool = True,
        seed: Seed = 0,
    ) -> None:
        """
        Args:
            enable_corruption: False disables noise and biases.
            bias: Constant bias, per component or for all; added after the noise.
            noise: ``effects.Gaussian`` or ``effects.Uniform``, drawn anew for every value.
            operation: Operation of bias and noise: add, scale, abs (replace the value).
            episode_bias: Bias that is drawn at every reset (mjlab's noise model with additive bias), added after noise and bias.
            clip: Limits (low, high).
            scale: Factor, per component or for all; applied after clip.
            nan_policy: disabled, warn, sanitize (replace by 0) or error.
            delay_min_lag, delay_max_lag: Range of the delay, in control steps.
            delay_per_env: Draw a lag for each world. False: all worlds have the same lag.
            delay_hold_prob: Probability that a drawn lag is discarded and the previous one kept.
            delay_update_period: Number of control steps between draws; 0: every step.
            delay_per_env_phase: Give each world its own phase for the draws.
            history_length: Number of rows kept, oldest first; the first row of an episode fills all of them.
            flatten_history_dim: Return ``[B, history * D]`` instead of ``[B, history, D]``.

        Raises:
            ValueError: A setting is out of range.
        """
        settings = dict(locals())
        del settings["self"], settings["num_worlds"], settings["seed"]
        settings["scale"] = 1.0 if scale is None else scale
        self.num_worlds = num_worlds
        self._pipeline = _core.ObservationPipeline(_Settings(**settings), num_worlds, seed)
        self._complete = True

    @property
    def num_envs(self) -> int:
        """The old name of ``num_worlds``."""
        warnings.warn("ObservationPipeline.num_envs is now num_worlds", DeprecationWarning, stacklevel=2)
        return self.num_worlds

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """Clears the history and the state of the effects in these worlds: ids, a mask, or None for all."""
        self._pipeline.reset(None if world_ids is None else ids_of_worlds(world_ids, self.num_worlds).tolist())

    def __call__(self, values: Any) -> np.ndarray:
        """Processes the next rows and returns float32 ``[B, D]``, or ``[B, history * D]`` or ``[B, history, D]``."""
        rows = np.ascontiguousarray(values, dtype=np.float32)
        if rows.ndim != 2:
            raise ValueError(f"shape {rows.shape}: expected ({self.num_worlds}, D)")
        return self._pipeline.apply(rows)
