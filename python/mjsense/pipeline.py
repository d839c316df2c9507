"""mjlab's observation pipeline for values that do not come from a sensor: noise, clip, scale, NaN policy, delay, history.

Sensors have effects of their own, in physical units (see the page on effects); this one counts in control steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


class ObservationPipeline:
    """``pipeline(values)`` takes ``[B, D]`` once a control step and returns ``[B, D]``, or stacked frames with a history."""

    def __init__(
        self,
        num_envs: int,
        *,
        bias: float | Sequence[float] | None = None,
        noise: tuple[str, float, float] | None = None,
        operation: str = "add",
        clip: Sequence[float] | None = None,
        scale: float | Sequence[float] | None = None,
        nan_policy: str = "disabled",
        delay_min_lag: int = 0,
        delay_max_lag: int = 0,
        history_length: int = 0,
        flatten_history_dim: bool = True,
        seed: int = 0,
    ) -> None:
        """
        Args:
            bias: constant, per component or for all.
            noise: ("uniform", low, high) or ("gaussian", mean, std), drawn anew for every value.
            operation: of bias and noise: add, scale, abs (replace the value).
            clip: (low, high).
            scale: factor, per component or for all; after clip.
            nan_policy: disabled, sanitize (NaN and infinity become 0), error.
            delay_min_lag, delay_max_lag: control steps by which the value is late, drawn for each world and step.
            history_length: frames kept, oldest first; a world's first frame fills all.
            flatten_history_dim: ``[B, history * D]`` instead of ``[B, history, D]``.
        """
        if operation not in ("add", "scale", "abs"):
            raise ValueError(f"operation must be add, scale or abs, not {operation!r}")
        if nan_policy not in ("disabled", "sanitize", "error"):
            raise ValueError(f"nan_policy must be disabled, sanitize or error, not {nan_policy!r}")
        if noise is not None and noise[0] not in ("uniform", "gaussian"):
            raise ValueError(f"noise must be uniform or gaussian, not {noise[0]!r}")
        if not 0 <= delay_min_lag <= delay_max_lag:
            raise ValueError(f"delay lags {delay_min_lag}..{delay_max_lag}: expected 0 <= min <= max")
        if clip is not None and not clip[0] <= clip[1]:
            raise ValueError(f"clip {clip!r}: the first must not be larger than the second")
        self.num_envs = num_envs
        self._bias = None if bias is None else np.asarray(bias, np.float32)
        self._noise, self._operation = noise, operation
        self._clip, self._nan_policy = clip, nan_policy
        self._scale = None if scale is None else np.asarray(scale, np.float32)
        self._min_lag, self._max_lag = delay_min_lag, delay_max_lag
        self._history_length, self._flatten = history_length, flatten_history_dim
        self._rng = np.random.default_rng(seed)
        self._past: np.ndarray | None = None  # [B, max_lag + 1, D], newest first
        self._history: np.ndarray | None = None  # [B, history, D], oldest first
        self._age = np.zeros(num_envs, int)  # frames since the reset

    def reset(self, world_ids: Sequence[int] | None = None) -> None:
        """These worlds (None: all) forget what they have seen."""
        self._age[slice(None) if world_ids is None else np.asarray(world_ids, int)] = 0

    def __call__(self, values: Any) -> np.ndarray:
        x = np.array(values, dtype=np.float32)
        if x.shape[:1] != (self.num_envs,):
            raise ValueError(f"shape {x.shape}: expected {self.num_envs} worlds first")
        x = self._corrupt(x)
        if self._clip is not None:
            x = np.clip(x, *self._clip)
        if self._scale is not None:
            x = x * self._scale
        if self._nan_policy == "sanitize":
            x = np.nan_to_num(x, nan=0.0, posinf=0.0, neginf=0.0)
        elif self._nan_policy == "error" and not np.isfinite(x).all():
            raise ValueError(f"worlds {np.flatnonzero(~np.isfinite(x).reshape(self.num_envs, -1).all(1)).tolist()}: not finite")
        x = self._stack(self._delay(x))
        self._age += 1
        return x

    def _corrupt(self, x: np.ndarray) -> np.ndarray:
        if self._noise is None and self._bias is None:
            return x
        error = np.float32(0)
        if self._noise is not None:
            kind, a, b = self._noise
            draw = self._rng.uniform(a, b, x.shape) if kind == "uniform" else self._rng.normal(a, b, x.shape)
            error = draw.astype(np.float32)
        if self._bias is not None:
            error = error + self._bias
        if self._operation == "scale":
            return x * error
        return x + error if self._operation == "add" else np.broadcast_to(error, x.shape).astype(np.float32)

    def _delay(self, x: np.ndarray) -> np.ndarray:
        if self._max_lag == 0:
            return x
        if self._past is None:
            self._past = np.zeros((self.num_envs, self._max_lag + 1, *x.shape[1:]), np.float32)
        self._past[:, 1:] = self._past[:, :-1].copy()
        self._past[:, 0] = x
        lag = self._rng.integers(self._min_lag, self._max_lag + 1, self.num_envs)
        return self._past[np.arange(self.num_envs), np.minimum(lag, self._age)]

    def _stack(self, x: np.ndarray) -> np.ndarray:
        if self._history_length < 1:
            return x
        if self._history is None:
            self._history = np.zeros((self.num_envs, self._history_length, *x.shape[1:]), np.float32)
        self._history[:, :-1] = self._history[:, 1:].copy()
        self._history[:, -1] = x
        first = self._age == 0
        self._history[first] = x[first, None]
        return self._history.copy().reshape(self.num_envs, -1) if self._flatten else self._history.copy()
