# SPDX-License-Identifier: Apache-2.0
"""mjlab's observation pipeline for values that do not come from a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense import _core, effects
from mjsense._arguments import KnownAttributes, Seed, checked


@checked
class ObservationPipeline(KnownAttributes):
    """Noise, clip, scale, NaN policy, delay, history, in this order: ``pipeline(values)`` takes ``[B, D]`` once a control step.

    For sensors use :class:`mjsense.EffectSensorCfg`: the same effects, inside the simulation.
    """

    def __init__(
        self,
        num_envs: int,
        *,
        bias: float | Sequence[float] | None = None,
        noise: Any = None,
        operation: str = "add",
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
            bias: constant, per component or for all.
            noise: ``effects.Gaussian`` or ``effects.Uniform``, drawn anew for every value.
            operation: of bias and noise: add, scale, abs (replace the value).
            clip: (low, high).
            scale: factor, per component or for all; after clip.
            nan_policy: disabled, warn, sanitize (0), error.
            delay_min_lag, delay_max_lag: control steps by which the value is late.
            history_length: frames kept, oldest first; a world's first frame fills all.
            flatten_history_dim: ``[B, history * D]`` instead of ``[B, history, D]``.
        """
        chain: list[Any] = []
        for draw in (noise, None if bias is None else effects.Constant(bias)):
            if draw is not None:
                chain.append(effects.Noise(draw, operation))
        if clip is not None:
            chain.append(effects.Clip(*clip))
        if scale is not None:
            chain.append(effects.Scale(scale))
        if nan_policy != "disabled":
            chain.append(effects.NanPolicy(nan_policy))
        if delay_max_lag or delay_min_lag:
            chain.append(
                effects.StepDelay(
                    delay_min_lag, delay_max_lag, delay_per_env, delay_hold_prob, delay_update_period, delay_per_env_phase
                )
            )
        self.num_envs = num_envs
        self._config = SimpleNamespace(effects=chain, history_length=history_length, flatten_history=flatten_history_dim)
        self._seed = seed
        self._chain: Any = None
        if operation not in ("add", "scale", "abs"):
            raise ValueError(f"operation must be add, scale or abs, not {operation!r}")
        self._complete = True

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """These worlds (None: all) forget what they have seen."""
        if self._chain is not None:
            self._chain.reset(None if world_ids is None else [int(w) for w in world_ids])

    def __call__(self, values: Any) -> np.ndarray:
        rows = np.ascontiguousarray(values, dtype=np.float32)
        if rows.ndim != 2 or len(rows) != self.num_envs:
            raise ValueError(f"shape {rows.shape}: expected ({self.num_envs}, D)")
        if self._chain is None:
            self._chain = _core.EffectChain(self._config, rows.shape[1], self.num_envs, 1.0, self._seed)
        return self._chain.apply(rows).copy()
