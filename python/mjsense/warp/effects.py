# SPDX-License-Identifier: Apache-2.0
"""The effects of ``mjsense.effects`` on rows ``[B, size]`` of a device. Arithmetic is float64 in the order of the C++ library, and
random numbers are the same, so that rows are equal bit for bit where the device's log, sin, cos and exp are those of the host; see
the page of the backend for the bound elsewhere.

Each effect is an object with ``apply(row)`` and ``reset(mask)``, which only launch kernels.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from mjsense import effects as configs
from mjsense.warp.random import Rng, below, make_rng, normal, normal_at, stream_of, uniform, uniform_of_words, word

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

_GAUSSIAN, _UNIFORM = wp.constant(0), wp.constant(1)
_ADD, _SCALE = wp.constant(0), wp.constant(1)
_OPERATIONS = {"add": 0, "scale": 1, "abs": 2}
_TIME_TOLERANCE = wp.constant(wp.float64(1e-9))  # s, for the rounding of tick * timestep
_ZERO = wp.constant(wp.float64(0.0))
_ONE = wp.constant(wp.float64(1.0))
_INFINITY = wp.constant(wp.float64(math.inf))


@wp.struct
class Clock:
    """The time at which each world's row is measured (``EffectTime`` in C++)."""

    seed: wp.array(dtype=wp.uint64)  # [1]
    key: wp.array(dtype=wp.uint32)  # [B]
    tick: wp.array(dtype=wp.int64)  # [B]
    episode: wp.array(dtype=wp.int64)  # [B]
    tick_s: wp.float64
    last_tick: wp.array(dtype=wp.int64)  # [B]
    fresh: wp.array(dtype=bool)  # [B] no row since the reset
    first: wp.array(dtype=bool)  # [B] the first row of an episode
    advance: wp.array(dtype=bool)  # [B] false: this tick's row is measured again
    elapsed: wp.array(dtype=wp.float64)  # [B] s since the previous row


@wp.func
def _rng(clock: Clock, w: int, stream: wp.uint32) -> Rng:
    return make_rng(clock.seed[0], clock.key[w], stream, clock.tick[w])


@wp.func
def _episode_rng(clock: Clock, w: int, stream: wp.uint32) -> Rng:
    return make_rng(clock.seed[0], clock.key[w], stream, clock.episode[w])


@wp.kernel
def _tell_time(clock: Clock):
    w = wp.tid()
    fresh = clock.fresh[w]
    advance = fresh or clock.tick[w] != clock.last_tick[w]
    clock.advance[w] = advance
    clock.first[w] = fresh or (clock.first[w] and not advance)
    elapsed = _ZERO
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


# ------------------------------------------------------------------------------------------------------------ distributions


@wp.struct
class Draw:
    """A distribution: mean and standard deviation, bounds, or a constant; one value for each component."""

    kind: int
    a: wp.array(dtype=wp.float64)
    b: wp.array(dtype=wp.float64)


@wp.func
def _sample(draw: Draw, rng: Rng, i: int, n: int) -> wp.float64:
    """Component ``i``, from number ``n`` of the stream."""
    if draw.kind == _GAUSSIAN:
        return draw.a[i] + draw.b[i] * normal(rng, n)
    if draw.kind == _UNIFORM:
        return draw.a[i] + (draw.b[i] - draw.a[i]) * uniform(rng, n)
    return draw.a[i]


@wp.func
def _operate(operation: int, x: wp.float64, e: wp.float64) -> wp.float64:
    if operation == _ADD:
        return x + e
    if operation == _SCALE:
        return x * e
    return e


def _values(values: Any, size: int, device: Any) -> wp.array:
    """One float64 for each component."""
    return wp.array(np.broadcast_to(np.asarray(values, np.float64), (size,)).copy(), dtype=wp.float64, device=device)


def _draw(cfg: Any, size: int, device: Any) -> Draw:
    draw = Draw()
    if isinstance(cfg, configs.Gaussian):
        draw.kind, first, second = 0, cfg.mean, cfg.std
    elif isinstance(cfg, configs.Uniform):
        draw.kind, first, second = 1, cfg.low, cfg.high
    else:
        draw.kind, first, second = 2, cfg.value if isinstance(cfg, configs.Constant) else cfg, 0.0
    draw.a, draw.b = _values(first, size, device), _values(second, size, device)
    return draw


# -------------------------------------------------------------------------------------------------------------------- noise


@wp.kernel
def _noise(
    clock: Clock,
    stream: wp.uint32,
    draw: Draw,
    operation: int,
    density: wp.array(dtype=wp.float64),
    density_factor: wp.float64,
    row: wp.array2d(dtype=float),
):
    w, i = wp.tid()
    rng = _rng(clock, w, stream)
    x = wp.float64(row[w, i])
    if density_factor == _ZERO:
        row[w, i] = float(_operate(operation, x, _sample(draw, rng, i, i)))
        return
    # The draw of a component is followed by its density's normal number; normal numbers come in pairs.
    e = draw.a[i]
    extra = _ZERO
    if draw.kind == _GAUSSIAN:
        e = _sample(draw, rng, i, 2 * i)
        extra = normal(rng, 2 * i + 1)
    elif draw.kind == _UNIFORM:
        begin = 4 * (i // 2)
        e = _sample(draw, rng, i, begin + 3 * (i % 2))
        extra = normal_at(rng, begin + 1, i % 2 == 1)
    else:
        extra = normal(rng, i)
    row[w, i] = float(_operate(operation, x, e) + density[i] * density_factor * extra)


class _Effect:
    """An effect on rows of ``size`` elements; the clock's arrays belong to the chain."""

    def __init__(
        self, clock: Clock, cfg: Any, stream: int, size: int, dtype: Any, num_worlds: int, period: float, device: Any
    ) -> None:
        self.clock, self.cfg, self.stream = clock, cfg, stream
        self.size, self.dtype, self.num_worlds, self.period, self.device = size, dtype, num_worlds, period, device
        self.initialize()

    def initialize(self) -> None:
        """Allocates memory."""

    def apply(self, row: wp.array) -> None:
        raise NotImplementedError

    def reset(self, mask: wp.array) -> None:
        """Starts an episode of the worlds of the mask."""

    def check(self) -> None:
        """Raises an error for values that the effect has refused. Reads from the device."""

    def zeros(self, *shape: int, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self.device)

    def per_element(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(kernel, dim=(self.num_worlds, self.size), inputs=[self.clock, *inputs], device=self.device)

    def per_world(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(kernel, dim=self.num_worlds, inputs=[self.clock, *inputs], device=self.device)


class _Noise(_Effect):
    def initialize(self) -> None:
        cfg = self.cfg
        self.draw = _draw(cfg.draw, self.size, self.device)
        self.density = _values(cfg.density, self.size, self.device)
        self.factor = 1.0 / math.sqrt(self.period) if np.any(np.asarray(cfg.density) > 0) else 0.0

    def apply(self, row: wp.array) -> None:
        self.per_element(_noise, self.stream, self.draw, _OPERATIONS[self.cfg.operation], self.density, self.factor, row)


@wp.func
def _new_bias(
    clock: Clock, stream: wp.uint32, draw: Draw, operation: int, shared: bool, w: int, i: int, old: wp.float64
) -> wp.float64:
    component = i
    if shared:
        component = 0
    if clock.episode[w] <= wp.int64(1):
        old = _ZERO
    return _operate(operation, old, _sample(draw, _episode_rng(clock, w, stream), component, component))


@wp.kernel
def _draw_bias(
    clock: Clock,
    mask: wp.array(dtype=bool),
    stream: wp.uint32,
    draw: Draw,
    operation: int,
    shared: bool,
    bias: wp.array2d(dtype=wp.float64),
    drawn: wp.array2d(dtype=bool),
):
    w, i = wp.tid()
    if mask[w]:
        bias[w, i] = _new_bias(clock, stream, draw, operation, shared, w, i, bias[w, i])
        drawn[w, i] = True


@wp.kernel
def _add_bias(
    clock: Clock,
    stream: wp.uint32,
    draw: Draw,
    operation: int,
    shared: bool,
    bias: wp.array2d(dtype=wp.float64),
    drawn: wp.array2d(dtype=bool),
    row: wp.array2d(dtype=float),
):
    w, i = wp.tid()
    if not drawn[w, i]:
        bias[w, i] = _new_bias(clock, stream, draw, operation, shared, w, i, bias[w, i])
        drawn[w, i] = True
    row[w, i] = float(wp.float64(row[w, i]) + bias[w, i])


class _EpisodeBias(_Effect):
    def initialize(self) -> None:
        self.bias = self.zeros(self.num_worlds, self.size, dtype=wp.float64)
        self.drawn = self.zeros(self.num_worlds, self.size, dtype=bool)
        draw = _draw(self.cfg.draw, self.size, self.device)
        self.fixed = (self.stream, draw, _OPERATIONS[self.cfg.operation], not self.cfg.per_component, self.bias, self.drawn)

    def reset(self, mask: wp.array) -> None:
        self.per_element(_draw_bias, mask, *self.fixed)

    def apply(self, row: wp.array) -> None:
        self.per_element(_add_bias, *self.fixed, row)


@wp.kernel
def _drift(
    clock: Clock,
    stream: wp.uint32,
    first_stream: wp.uint32,
    std: wp.array(dtype=wp.float64),
    density: wp.array(dtype=wp.float64),
    time_constant: wp.float64,
    start_at_zero: bool,
    bias: wp.array2d(dtype=wp.float64),
    row: wp.array2d(dtype=float),
):
    w, i = wp.tid()
    if clock.advance[w]:
        if clock.first[w]:
            bias[w, i] = _ZERO
            if not start_at_zero:
                bias[w, i] = std[i] * normal(_episode_rng(clock, w, first_stream), i)
        else:
            keep = wp.exp(-clock.elapsed[w] / time_constant)
            fresh = wp.sqrt(_ONE - keep * keep)
            walk = wp.sqrt(clock.elapsed[w])
            bias[w, i] = keep * bias[w, i] + (std[i] * fresh + density[i] * walk) * normal(_rng(clock, w, stream), i)
    row[w, i] = float(wp.float64(row[w, i]) + bias[w, i])


class _BiasDrift(_Effect):
    def initialize(self) -> None:
        cfg = self.cfg
        std, density = (_values(values, self.size, self.device) for values in (cfg.std, cfg.density))
        bias = self.zeros(self.num_worlds, self.size, dtype=wp.float64)
        self.fixed = (self.stream, self.stream ^ 0x5BD1E995, std, density, cfg.time_constant_s, cfg.start_at_zero, bias)

    def apply(self, row: wp.array) -> None:
        self.per_element(_drift, *self.fixed, row)


# -------------------------------------------------------------------------------------------------------------- calibration


@wp.kernel
def _scale(clock: Clock, factor: wp.array(dtype=wp.float64), row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    row[w, i] = float(wp.float64(row[w, i]) * factor[i])


@wp.kernel
def _clip(clock: Clock, low: wp.array(dtype=wp.float64), high: wp.array(dtype=wp.float64), row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    x = wp.float64(row[w, i])
    if x < low[i]:  # NaN stays NaN
        x = low[i]
    elif x > high[i]:
        x = high[i]
    row[w, i] = float(x)


@wp.kernel
def _quantize(clock: Clock, step: wp.array(dtype=wp.float64), row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    s = step[i]
    if s > _ZERO:
        row[w, i] = float(s * wp.round(wp.float64(row[w, i]) / s))


class _Scale(_Effect):
    def initialize(self) -> None:
        self.factor = _values(self.cfg.factor, self.size, self.device)

    def apply(self, row: wp.array) -> None:
        self.per_element(_scale, self.factor, row)


class _Clip(_Effect):
    def initialize(self) -> None:
        self.limits = [_values(values, self.size, self.device) for values in (self.cfg.low, self.cfg.high)]

    def apply(self, row: wp.array) -> None:
        self.per_element(_clip, *self.limits, row)


class _Quantize(_Effect):
    def initialize(self) -> None:
        self.step = _values(self.cfg.step, self.size, self.device)

    def apply(self, row: wp.array) -> None:
        self.per_element(_quantize, self.step, row)


@wp.func
def _new_matrix(
    clock: Clock, stream: wp.uint32, scale: wp.vec3d, angle: wp.vec3d, scale_std: wp.float64, angle_std: wp.float64, w: int
) -> wp.mat33d:
    rng = _episode_rng(clock, w, stream)
    s = wp.vec3d()
    a = wp.vec3d()
    for k in range(3):
        s[k] = _ONE + scale[k] + scale_std * normal(rng, k)
        a[k] = angle[k] + angle_std * normal(rng, 3 + k)
    cx = wp.cos(a[0])
    sx = wp.sin(a[0])
    cy = wp.cos(a[1])
    sy = wp.sin(a[1])
    cz = wp.cos(a[2])
    sz = wp.sin(a[2])
    # diag(s) Rz Ry Rx
    return wp.mat33d(
        s[0] * (cz * cy),
        s[0] * (cz * sy * sx - sz * cx),
        s[0] * (cz * sy * cx + sz * sx),
        s[1] * (sz * cy),
        s[1] * (sz * sy * sx + cz * cx),
        s[1] * (sz * sy * cx - cz * sx),
        s[2] * (-sy),
        s[2] * (cy * sx),
        s[2] * (cy * cx),
    )


@wp.kernel
def _draw_matrix(
    clock: Clock,
    mask: wp.array(dtype=bool),
    stream: wp.uint32,
    scale: wp.vec3d,
    angle: wp.vec3d,
    scale_std: wp.float64,
    angle_std: wp.float64,
    matrix: wp.array(dtype=wp.mat33d),
    drawn: wp.array(dtype=bool),
):
    w = wp.tid()
    if mask[w]:
        matrix[w] = _new_matrix(clock, stream, scale, angle, scale_std, angle_std, w)
        drawn[w] = True


@wp.kernel
def _misalign(
    clock: Clock,
    stream: wp.uint32,
    scale: wp.vec3d,
    angle: wp.vec3d,
    scale_std: wp.float64,
    angle_std: wp.float64,
    matrix: wp.array(dtype=wp.mat33d),
    drawn: wp.array(dtype=bool),
    row: wp.array2d(dtype=float),
):
    w = wp.tid()
    if not drawn[w]:
        matrix[w] = _new_matrix(clock, stream, scale, angle, scale_std, angle_std, w)
        drawn[w] = True
    m = matrix[w]
    for k in range(row.shape[1] // 3):
        x = wp.float64(row[w, 3 * k])
        y = wp.float64(row[w, 3 * k + 1])
        z = wp.float64(row[w, 3 * k + 2])
        for i in range(3):
            row[w, 3 * k + i] = float(m[i, 0] * x + m[i, 1] * y + m[i, 2] * z)


class _Misalignment(_Effect):
    def initialize(self) -> None:
        cfg = self.cfg
        matrix, drawn = self.zeros(self.num_worlds, dtype=wp.mat33d), self.zeros(self.num_worlds, dtype=bool)
        self.fixed = (
            self.stream,
            wp.vec3d(*cfg.scale_error),
            wp.vec3d(*cfg.angle),
            cfg.scale_error_std,
            cfg.angle_std,
            matrix,
            drawn,
        )

    def reset(self, mask: wp.array) -> None:
        self.per_world(_draw_matrix, mask, *self.fixed)

    def apply(self, row: wp.array) -> None:
        self.per_world(_misalign, *self.fixed, row)


@wp.kernel
def _find_nan(clock: Clock, sanitize: bool, bad: wp.array(dtype=int), row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    if not wp.isfinite(row[w, i]):
        if sanitize:
            row[w, i] = float(_ZERO)
        else:
            wp.atomic_add(bad, w, 1)


class _NanPolicy(_Effect):
    def initialize(self) -> None:
        self.bad = self.zeros(self.num_worlds, dtype=int)
        self.context = ""  # set by the chain
        self.warned: set[int] = set()

    def apply(self, row: wp.array) -> None:
        action = self.cfg.action
        if action != "disabled":
            self.bad.zero_()
            self.per_element(_find_nan, action == "sanitize", self.bad, row)

    def check(self) -> None:
        if self.cfg.action not in ("warn", "error"):
            return
        bad = self.bad.numpy()
        for world in np.flatnonzero(bad).tolist():
            message = f"{self.context}: {bad[world]} of {self.size} values are not finite in world {world}"
            if self.cfg.action == "error":
                raise RuntimeError(message)
            if world not in self.warned:
                self.warned.add(world)
                print(message, file=sys.stderr)


# ------------------------------------------------------------------------------------------------------------------- timing


@wp.struct
class Ring:
    """The last rows of every world, with their times; the rows are an array of their own, because they have any dtype."""

    capacity: int
    newest: wp.array(dtype=int)  # [B]
    count: wp.array(dtype=int)  # [B]
    time: wp.array2d(dtype=wp.float64)  # [B, capacity] s


def _ring(effect: _Effect, capacity: int) -> tuple[Ring, wp.array]:
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
                lag[w] = delay + (delay_max - delay) * uniform(_episode_rng(clock, w, stream), 0)
        _push(ring, w, clock.first[w], now)
    jitter = _ZERO
    if jitter_s > _ZERO:
        jitter = -jitter_s + (jitter_s - (-jitter_s)) * uniform(_rng(clock, w, jitter_stream), 0)
    output_time[w] = wp.max(output_time[w], now - wp.max(_ZERO, lag[w] + jitter))
    t = output_time[w]
    age = int(0)
    while age + 1 < ring.count[w] and ring.time[w, _slot(ring, w, age)] > t + _TIME_TOLERANCE:
        age += 1
    before = ring.time[w, _slot(ring, w, age)]
    slots[w, 0] = _slot(ring, w, age)
    slots[w, 1] = slots[w, 0]
    fraction[w] = _ZERO
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


class _Delay(_Effect):
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
        rng = _rng(clock, w, stream)
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
                phase[w] = int(below(_episode_rng(clock, w, stream), wp.uint32(update_period), 0)[0])
        elif not hold:
            if update_period == 0 or (rows[w] + phase[w]) % update_period == 0:
                lag[w] = new_lag
        rows[w] = rows[w] + 1
        _push(ring, w, clock.first[w], _ZERO)
    slots[w, 0] = _slot(ring, w, lag[w])


class _StepDelay(_Effect):
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
            phase[w] = uniform(_episode_rng(clock, w, stream), 0) / rate
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


class _Rate(_Effect):
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
    arrived[w] = clock.first[w] or uniform(_rng(clock, w, stream), 0) >= probability


@wp.kernel
def _replace(clock: Clock, arrived: wp.array(dtype=bool), value: wp.float64, row: wp.array2d[Any]):
    w, i = wp.tid()
    if not arrived[w]:
        row[w, i] = row.dtype(value)


class _Dropout(_Effect):
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


_EFFECTS: dict[type, type[_Effect]] = {
    configs.Noise: _Noise,
    configs.EpisodeBias: _EpisodeBias,
    configs.BiasDrift: _BiasDrift,
    configs.Scale: _Scale,
    configs.Misalignment: _Misalignment,
    configs.Clip: _Clip,
    configs.Quantize: _Quantize,
    configs.NanPolicy: _NanPolicy,
    configs.Delay: _Delay,
    configs.StepDelay: _StepDelay,
    configs.Rate: _Rate,
    configs.Dropout: _Dropout,
}


# -------------------------------------------------------------------------------------------------------------------- chain


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
for _dtype in (wp.float32, wp.int32, wp.uint8, wp.bool):
    _row, _rows = wp.array2d(dtype=_dtype), wp.array3d(dtype=_dtype)
    wp.overload(_take, {"rows": _rows, "row": _row})
    wp.overload(_hold, {"held": _row, "row": _row})
    wp.overload(_replace, {"row": _row})
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
        effects: Configurations from ``mjsense.effects``, checked already.
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
        clock.last_tick = wp.zeros(count, dtype=wp.int64, device=device)
        clock.fresh = wp.full(count, True, dtype=bool, device=device)
        clock.first, clock.advance = (wp.zeros(count, dtype=bool, device=device) for _ in range(2))
        clock.elapsed = wp.zeros(count, dtype=wp.float64, device=device)
        self.effects = [
            _EFFECTS[type(cfg)](clock, cfg, stream_of(f"{stream}#{i}"), size, source.dtype, count, worlds.step_dt, device)
            for i, cfg in enumerate(effects)
        ]
        for i, effect in enumerate(self.effects):
            if isinstance(effect, _NanPolicy):
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
