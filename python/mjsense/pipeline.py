# SPDX-License-Identifier: Apache-2.0
"""mjlab's observation pipeline for values that do not come from a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense import _core, effects
from mjsense._arguments import KnownAttributes, Seed, checked


class _Settings(SimpleNamespace):
    """The fields of the C++ pipeline's configuration."""


_Settings.__name__ = "ObservationPipeline"  # as messages call it


@checked
class ObservationPipeline(KnownAttributes):
    """Noise, bias, clip, scale, NaN policy, delay, history, in this order: ``pipeline(values)`` takes ``[B, D]`` once a control step.

    For sensors use :class:`mjsense.EffectSensorCfg`: the same effects, inside the simulation.
    """

    def __init__(
        self,
        num_envs: int,
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
            enable_corruption: False leaves noise and biases out.
            bias: constant, per component or for all; after the noise.
            noise: ``effects.Gaussian`` or ``effects.Uniform``, drawn anew for every value.
            operation: of bias and noise: add, scale, abs (replace the value).
            episode_bias: drawn at every reset (mjlab's noise model with additive bias), after noise and bias.
            clip: (low, high).
            scale: factor, per component or for all; after clip.
            nan_policy: disabled, warn, sanitize (0), error.
            delay_min_lag, delay_max_lag: control steps by which the value is late.
            delay_per_env: False: all worlds have the same lag.
            delay_hold_prob: that a drawn lag is not taken.
            delay_update_period: control steps between draws; 0: every step.
            delay_per_env_phase: worlds draw at steps of their own.
            history_length: frames kept, oldest first; a world's first frame fills all.
            flatten_history_dim: ``[B, history * D]`` instead of ``[B, history, D]``.

        Raises:
            ValueError: a setting is out of its range.
        """
        settings = _Settings(
            enable_corruption=enable_corruption,
            noise=noise,
            bias=bias,
            operation=operation,
            episode_bias=episode_bias,
            clip=clip,
            scale=1.0 if scale is None else scale,
            nan_policy=nan_policy,
            delay_min_lag=delay_min_lag,
            delay_max_lag=delay_max_lag,
            delay_per_env=delay_per_env,
            delay_hold_prob=delay_hold_prob,
            delay_update_period=delay_update_period,
            delay_per_env_phase=delay_per_env_phase,
            history_length=history_length,
            flatten_history_dim=flatten_history_dim,
        )
        self.num_envs = num_envs
        self._pipeline = _core.ObservationPipeline(settings, num_envs, seed)
        self._complete = True

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """These worlds (None: all) forget what they have seen."""
        self._pipeline.reset(None if world_ids is None else [int(w) for w in world_ids])

    def __call__(self, values: Any) -> np.ndarray:
        """The next rows: float32 ``[B, D]``, or with a history ``[B, history * D]`` or ``[B, history, D]``."""
        rows = np.ascontiguousarray(values, dtype=np.float32)
        if rows.ndim != 2:
            raise ValueError(f"shape {rows.shape}: expected ({self.num_envs}, D)")
        return self._pipeline.apply(rows)
