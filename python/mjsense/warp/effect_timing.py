# SPDX-License-Identifier: Apache-2.0
"""Effects on time: delays, rates and lost rows."""

from __future__ import annotations

import math
from typing import Any

import warp as wp

from mjsense.sensors import effects as configs
from mjsense.warp.effect_base import ROW_TYPES, ZERO, Clock, Effect, episode_rng, step_rng
from mjsense.warp.random import below, uniform, uniform_of_words, word

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the arithmetic of the C++ library, bit for bit

_TIME_TOLERANCE = wp.constant(wp.float64(1e-9))  # s, for the rounding of tick * timestep
_INFINITY = wp.constant(wp.float64(math.inf))


@wp.struct
class Ring:
    """The last rows of every world, with their times; the rows are an array of their own, because they have any dtype."""

    capacity: int
    newest: wp.array(dtype=int)  # [B]
    count: wp.array(dtype=int)  # [B]
    time: wp.array2d(dtype=wp.float64)  # [B, capacity] s


def _ring(effect: Effect, capacity: int) -> tuple[Ring, wp.array]:
    ring, worlds = Ring(), effect.num_worlds
    ring.capacity = capacity
    ring.newest, ring.count = effect.zeros(worlds, dtype=int), effect.zeros(worlds, dtype=int)
    ring.time = effect.zeros(worlds, capacity, dtype=wp.float64)
    return ring, effect.zeros(worlds, capacity, effect.size, dtype=effect.dtype)


@wp.func
def _slot(ring: Ring, w: int, age: int) -> int:
    """Index of the row of this age; ages beyond the oldest row give the oldest."""
    return (ring.newest[w] - wp.min(age, ring.count[w] - 1) + ring.capacity) % ring.capacity


@wp.func
def _push(ring: Ring, w: int, first: bool, time: wp.float64):
    if first:
        ring.count[w] = 0
    ring.newest[w] = (ring.newest[w] + 1) % ring.capacity
    ring.count[w] = wp.min(ring.count[w] + 1, ring.capacity)
    ring.time[w, ring.newest[w]] = time


@wp.kernel
def _delay(
    clock: Clock,
    stream: wp.uint32,
    jitter_stream: wp.uint32,
    delay: wp.float64,
    delay_max: wp.float64,
    jitter_s: wp.float64,
    interpolate: bool,
    ring: Ring,
    lag: wp.array(dtype=wp.float64),
    output_time: wp.array(dtype=wp.float64),
    slots: wp.array2d(dtype=int),  # [B, 2] the row, and the next one
    fraction: wp.array(dtype=wp.float64),  # of the way to the next one
):
    w = wp.tid()
    now = wp.float64(clock.tick[w]) * clock.tick_s
    if clock.advance[w]:
        if clock.first[w]:
            lag[w] = delay
            output_time[w] = -_INFINITY
            if delay_max > delay:
                lag[w] = delay + (delay_max - delay) * uniform(episode_rng(clock, w, stream), 0)
        _push(ring, w, clock.first[w], now)
    jitter = ZERO
    if jitter_s > ZERO:
        jitter = -jitter_s + (jitter_s - (-jitter_s)) * uniform(step_rng(clock, w, jitter_stream), 0)
    output_time[w] = wp.max(output_time[w], now - wp.max(ZERO, lag[w] + jitter))
    t = output_time[w]
    age = int(0)
    while age + 1 < ring.count[w] and ring.time[w, _slot(ring, w, age)] > t + _TIME_TOLERANCE:
        age += 1
    before = ring.time[w, _slot(ring, w, age)]
    slots[w, 0] = _slot(ring, w, age)
    slots[w, 1] = slots[w, 0]
    fraction[w] = ZERO
    if interpolate and age > 0 and t > before + _TIME_TOLERANCE:
        slots[w, 1] = _slot(ring, w, age - 1)
        fraction[w] = (t - before) / (ring.time[w, slots[w, 1]] - before)


@wp.kernel
def _take_between(
    clock: Clock,
    ring: Ring,
    slots: wp.array2d(dtype=int),
    fraction: wp.array(dtype=wp.float64),
    rows: wp.array3d(dtype=float),
    row: wp.array2d(dtype=float),
):
    w, i = wp.tid()
    rows[w, ring.newest[w], i] = row[w, i]
    old = wp.float64(rows[w, slots[w, 0], i])
    if slots[w, 1] != slots[w, 0]:
        row[w, i] = float(old + fraction[w] * (wp.float64(rows[w, slots[w, 1], i]) - old))
    else:
        row[w, i] = rows[w, slots[w, 0], i]


@wp.kernel
def _take(clock: Clock, ring: Ring, slots: wp.array2d(dtype=int), rows: wp.array3d[Any], row: wp.array2d[Any]):
    w, i = wp.tid()
    rows[w, ring.newest[w], i] = row[w, i]
    row[w, i] = rows[w, slots[w, 0], i]


class _Delay(Effect):
    def initialize(self) -> None:
        cfg, worlds = self.cfg, self.num_worlds
        rows = (max(cfg.delay_s, cfg.delay_max_s) + cfg.jitter_s) / self.period
        self.ring, self.rows = _ring(self, math.ceil(rows) + 2)
        lag, output_time, self.fraction = (self.zeros(worlds, dtype=wp.float64) for _ in range(3))
        self.slots = self.zeros(worlds, 2, dtype=int)
        times = (cfg.delay_s, cfg.delay_max_s, cfg.jitter_s, cfg.interpolate)
        self.fixed = (self.stream, self.stream ^ 0x9E3779B9, *times, self.ring, lag, output_time, self.slots, self.fraction)

    def apply(self, row: wp.array) -> None:
        self.per_world(_delay, *self.fixed)
        if self.cfg.interpolate:
            self.per_element(_take_between, self.ring, self.slots, self.fraction, self.rows, row)
        else:
            self.per_element(_take, self.ring, self.slots, self.rows, row)


@wp.kernel
def _step_delay(
    clock: Clock,
    stream: wp.uint32,
    min_lag: int,
    max_lag: int,
    per_world: bool,
    hold_probability: wp.float64,
    update_period: int,
    per_world_phase: bool,
    ring: Ring,
    lag: wp.array(dtype=int),
    rows: wp.array(dtype=int),
    phase: wp.array(dtype=int),
    slots: wp.array2d(dtype=int),
):
    w = wp.tid()
    if clock.advance[w]:
        rng = step_rng(clock, w, stream)
        if not per_world:
            rng.world = wp.uint32(0)
        drawn = below(rng, wp.uint32(max_lag - min_lag + 1), 0)
        new_lag = min_lag + int(drawn[0])
        n = int(drawn[1])
        hold = uniform_of_words(word(rng, n), word(rng, n + 1)) < hold_probability
        if clock.first[w]:
            lag[w] = new_lag
            rows[w] = 0
            phase[w] = 0
            if per_world_phase and update_period > 0:
                phase[w] = int(below(episode_rng(clock, w, stream), wp.uint32(update_period), 0)[0])
        elif not hold:
            if update_period == 0 or (rows[w] + phase[w]) % update_period == 0:
                lag[w] = new_lag
        rows[w] = rows[w] + 1
        _push(ring, w, clock.first[w], ZERO)
    slots[w, 0] = _slot(ring, w, lag[w])


class _StepDelay(Effect):
    def initialize(self) -> None:
        cfg, worlds = self.cfg, self.num_worlds
        self.ring, self.rows = _ring(self, cfg.max_lag + 1)
        lag, rows, phase = (self.zeros(worlds, dtype=int) for _ in range(3))
        self.slots = self.zeros(worlds, 1, dtype=int)
        lags = (cfg.min_lag, cfg.max_lag, cfg.per_world, cfg.hold_probability, cfg.update_period, cfg.per_world_phase)
        self.fixed = (self.stream, *lags, self.ring, lag, rows, phase, self.slots)

    def apply(self, row: wp.array) -> None:
        self.per_world(_step_delay, *self.fixed)
        self.per_element(_take, self.ring, self.slots, self.rows, row)


@wp.kernel
def _rate(
    clock: Clock,
    stream: wp.uint32,
    rate: wp.float64,
    random_phase: bool,
    phase: wp.array(dtype=wp.float64),
    number: wp.array(dtype=wp.int64),
    is_new: wp.array(dtype=bool),
):
    w = wp.tid()
    if clock.advance[w]:
        if clock.first[w] and random_phase:
            phase[w] = uniform(episode_rng(clock, w, stream), 0) / rate
        now = wp.float64(clock.tick[w]) * clock.tick_s
        k = wp.int64(wp.floor((now - phase[w]) * rate + wp.float64(1.0e-6)))
        is_new[w] = clock.first[w] or k != number[w]
        number[w] = k


@wp.kernel
def _hold(clock: Clock, is_new: wp.array(dtype=bool), held: wp.array2d[Any], row: wp.array2d[Any]):
    w, i = wp.tid()
    if is_new[w]:
        held[w, i] = row[w, i]
    else:
        row[w, i] = held[w, i]


class _Rate(Effect):
    def initialize(self) -> None:
        cfg, worlds = self.cfg, self.num_worlds
        phase = wp.full(worlds, cfg.phase_s, dtype=wp.float64, device=self.device)
        number, self.is_new = self.zeros(worlds, dtype=wp.int64), self.zeros(worlds, dtype=bool)
        self.held = self.zeros(worlds, self.size, dtype=self.dtype)
        self.fixed = (self.stream, cfg.rate_hz, cfg.random_phase, phase, number, self.is_new)

    def apply(self, row: wp.array) -> None:
        self.per_world(_rate, *self.fixed)
        self.per_element(_hold, self.is_new, self.held, row)


@wp.kernel
def _lose(clock: Clock, stream: wp.uint32, probability: wp.float64, arrived: wp.array(dtype=bool)):
    w = wp.tid()
    # Without memory, the first row that is read may be a later one than the first of the episode.
    arrived[w] = clock.tick[w] == clock.started[w] or uniform(step_rng(clock, w, stream), 0) >= probability


@wp.kernel
def _replace(clock: Clock, arrived: wp.array(dtype=bool), value: wp.float64, row: wp.array2d[Any]):
    w, i = wp.tid()
    if not arrived[w]:
        row[w, i] = row.dtype(value)


class _Dropout(Effect):
    def initialize(self) -> None:
        self.arrived = self.zeros(self.num_worlds, dtype=bool)
        if self.cfg.mode == "hold":
            self.held = self.zeros(self.num_worlds, self.size, dtype=self.dtype)

    def apply(self, row: wp.array) -> None:
        self.per_world(_lose, self.stream, self.cfg.probability, self.arrived)
        if self.cfg.mode == "hold":
            self.per_element(_hold, self.arrived, self.held, row)
        else:
            self.per_element(_replace, self.arrived, wp.float64(math.nan if self.cfg.mode == "nan" else 0.0), row)


# Compiled with the module, which would be compiled again at the first use of another type.
for _dtype in ROW_TYPES:
    _row, _rows = wp.array2d(dtype=_dtype), wp.array3d(dtype=_dtype)
    wp.overload(_take, {"rows": _rows, "row": _row})
    wp.overload(_hold, {"held": _row, "row": _row})
    wp.overload(_replace, {"row": _row})


EFFECTS: dict[type, type[Effect]] = {
    configs.Delay: _Delay,
    configs.StepDelay: _StepDelay,
    configs.Rate: _Rate,
    configs.Dropout: _Dropout,
}
"""Configuration -> effect."""
