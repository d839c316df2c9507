# SPDX-License-Identifier: Apache-2.0
"""The effects of ``mjsense.sensors.effects`` on rows ``[B, size]`` of a device. Arithmetic is float64 in the order of the C++
library, and random numbers are the same, so that rows are equal bit for bit where the device's log, sin, cos and exp are those of
the host; see the page of the backend for the bound elsewhere.

Each effect is an object with ``apply(row)`` and ``reset(mask)``, which only launch kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp

from mjsense.sensors import effects as configs
from mjsense.warp import effect_errors, effect_timing
from mjsense.warp.effect_base import ROW_TYPES, ZERO, Clock
from mjsense.warp.random import stream_of

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the arithmetic of the C++ library, bit for bit

_EFFECTS = effect_errors.EFFECTS | effect_timing.EFFECTS


@wp.kernel
def _tell_time(clock: Clock):
    w = wp.tid()
    fresh = clock.fresh[w]
    advance = fresh or clock.tick[w] != clock.last_tick[w]
    clock.advance[w] = advance
    clock.first[w] = fresh or (clock.first[w] and not advance)
    elapsed = ZERO
    if not fresh:
        elapsed = wp.float64(clock.tick[w] - clock.last_tick[w]) * clock.tick_s
    clock.elapsed[w] = elapsed
    clock.last_tick[w] = clock.tick[w]
    clock.fresh[w] = False


@wp.kernel
def _start_episodes(mask: wp.array(dtype=bool), clock: Clock):
    w = wp.tid()
    if mask[w]:
        clock.fresh[w] = True
        clock.started[w] = clock.tick[w]


@wp.kernel
def _copy(source: wp.array2d[Any], row: wp.array2d[Any]):
    w, i = wp.tid()
    row[w, i] = source[w, i]


@wp.kernel
def _remember(clock: Clock, rows: int, row: wp.array2d[Any], out: wp.array3d[Any]):
    """Appends the row to the history, oldest first."""
    w, i = wp.tid()
    if clock.first[w]:
        for k in range(rows - 1):
            out[w, k, i] = row[w, i]
    elif clock.advance[w]:
        for k in range(rows - 1):
            out[w, k, i] = out[w, k + 1, i]
    out[w, rows - 1, i] = row[w, i]


# Compiled with the module, which would be compiled again at the first use of another type.
for _dtype in ROW_TYPES:
    _row, _rows = wp.array2d(dtype=_dtype), wp.array3d(dtype=_dtype)
    wp.overload(_copy, {"source": _row, "row": _row})
    wp.overload(_remember, {"row": _row, "out": _rows})


def needs_every_step(effects: Sequence[Any], history_length: int = 0) -> bool:
    """True if the effects have memory that advances with every control step."""
    memory = (configs.BiasDrift, configs.Delay, configs.StepDelay, configs.Rate)
    return history_length > 0 or any(
        isinstance(cfg, memory) or (isinstance(cfg, configs.Dropout) and cfg.mode == "hold") for cfg in effects
    )


class Chain:
    """Effects, in order, followed by a history, on the rows of all worlds (``EffectChain`` in C++).

    Args:
        worlds: Clocks, keys and seed of the worlds.
        effects: Configurations from ``mjsense.sensors.effects``, checked already.
        stream: Name of the stream of random numbers: the sensor, or ``sensor/field``.
        source: The rows, ``[B, ...]``.
        out: Where the results go: ``[B, ...]``, or ``[B, history_length, ...]``. Without history it may be ``source``.
        history_length: Number of last outputs, oldest first; 0: no history.
    """

    def __init__(
        self, worlds: Any, effects: Sequence[Any], stream: str, source: wp.array, out: wp.array, history_length: int = 0
    ) -> None:
        count, device = worlds.num_worlds, worlds.device
        size = source.size // count
        self.history_length, self.size, self.device, self.num_worlds = history_length, size, device, count
        self.source = source if source.ndim == 2 else source.reshape((count, size))  # a view of other rows may have gaps
        self.out = out.reshape((count, history_length, size) if history_length else (count, size))
        self.row = wp.zeros((count, size), dtype=source.dtype, device=device) if history_length else self.out
        clock = self.clock = Clock()
        clock.seed, clock.key, clock.tick, clock.episode = worlds.seed, worlds.key, worlds.tick, worlds.episode
        clock.tick_s = worlds.physics_dt
        clock.last_tick, clock.started = (wp.zeros(count, dtype=wp.int64, device=device) for _ in range(2))
        clock.fresh = wp.full(count, True, dtype=bool, device=device)
        clock.first, clock.advance = (wp.zeros(count, dtype=bool, device=device) for _ in range(2))
        clock.elapsed = wp.zeros(count, dtype=wp.float64, device=device)
        self.effects = [
            _EFFECTS[type(cfg)](clock, cfg, stream_of(f"{stream}#{i}"), size, source.dtype, count, worlds.step_dt, device)
            for i, cfg in enumerate(effects)
        ]
        for i, effect in enumerate(self.effects):
            if isinstance(effect, effect_errors.NanPolicy):
                effect.context = f"sensor '{stream}', effect {i} (nan_policy)"

    def apply(self) -> None:
        """Computes the row of the current tick of all worlds. A repeated call at the same tick replaces the newest row."""
        wp.launch(_tell_time, dim=self.num_worlds, inputs=[self.clock], device=self.device)
        if self.row.ptr != self.source.ptr:
            wp.launch(_copy, dim=self.row.shape, inputs=[self.source, self.row], device=self.device)
        for effect in self.effects:
            effect.apply(self.row)
        if self.history_length:
            inputs = [self.clock, self.history_length, self.row, self.out]
            wp.launch(_remember, dim=self.row.shape, inputs=inputs, device=self.device)

    def reset(self, mask: wp.array) -> None:
        """Starts an episode of the worlds of the mask; the next apply() has their first rows."""
        wp.launch(_start_episodes, dim=self.num_worlds, inputs=[mask, self.clock], device=self.device)
        for effect in self.effects:
            effect.reset(mask)

    def check(self) -> None:
        """Raises or prints what a NanPolicy has found in the current rows. Reads from the device."""
        for effect in self.effects:
            effect.check()
