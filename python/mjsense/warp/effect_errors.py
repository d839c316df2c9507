# SPDX-License-Identifier: Apache-2.0
"""Effects on values: noise, biases, calibration, range, and a policy for NaN."""

from __future__ import annotations

import math
import sys

import numpy as np
import warp as wp

from mjsense.sensors import effects as configs
from mjsense.warp.effect_base import (
    GAUSSIAN,
    ONE,
    OPERATIONS,
    UNIFORM,
    ZERO,
    Clock,
    Draw,
    Effect,
    draw_of,
    episode_rng,
    operate,
    sample,
    step_rng,
    values_of,
)
from mjsense.warp.random import normal, normal_at

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the arithmetic of the C++ library, bit for bit


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
    rng = step_rng(clock, w, stream)
    x = wp.float64(row[w, i])
    if density_factor == ZERO:
        row[w, i] = float(operate(operation, x, sample(draw, rng, i, i)))
        return
    # The draw of a component is followed by its density's normal number; normal numbers come in pairs.
    e = draw.a[i]
    extra = ZERO
    if draw.kind == GAUSSIAN:
        e = sample(draw, rng, i, 2 * i)
        extra = normal(rng, 2 * i + 1)
    elif draw.kind == UNIFORM:
        begin = 4 * (i // 2)
        e = sample(draw, rng, i, begin + 3 * (i % 2))
        extra = normal_at(rng, begin + 1, i % 2 == 1)
    else:
        extra = normal(rng, i)
    row[w, i] = float(operate(operation, x, e) + density[i] * density_factor * extra)


class _Noise(Effect):
    def initialize(self) -> None:
        cfg = self.cfg
        self.draw = draw_of(cfg.draw, self.size, self.device)
        self.density = values_of(cfg.density, self.size, self.device)
        self.factor = 1.0 / math.sqrt(self.period) if np.any(np.asarray(cfg.density) > 0) else 0.0

    def apply(self, row: wp.array) -> None:
        self.per_element(_noise, self.stream, self.draw, OPERATIONS[self.cfg.operation], self.density, self.factor, row)


@wp.struct
class Bias:
    """The bias of each episode, and its distribution."""

    stream: wp.uint32
    draw: Draw
    operation: int
    per_component: bool
    value: wp.array2d(dtype=wp.float64)  # [B, size]
    drawn: wp.array2d(dtype=bool)  # [B, size]


@wp.func
def _draw_bias(clock: Clock, bias: Bias, w: int, i: int):
    component = i
    if not bias.per_component:
        component = 0
    old = ZERO
    if clock.episode[w] > wp.int64(1):
        old = bias.value[w, i]
    drawn = sample(bias.draw, episode_rng(clock, w, bias.stream), component, component)
    bias.value[w, i] = operate(bias.operation, old, drawn)
    bias.drawn[w, i] = True


@wp.kernel
def _begin_bias(clock: Clock, mask: wp.array(dtype=bool), bias: Bias):
    w, i = wp.tid()
    if mask[w]:
        _draw_bias(clock, bias, w, i)


@wp.kernel
def _add_bias(clock: Clock, bias: Bias, row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    if not bias.drawn[w, i]:
        _draw_bias(clock, bias, w, i)
    row[w, i] = float(wp.float64(row[w, i]) + bias.value[w, i])


class _EpisodeBias(Effect):
    def initialize(self) -> None:
        cfg, bias = self.cfg, Bias()
        bias.stream, bias.draw = self.stream, draw_of(cfg.draw, self.size, self.device)
        bias.operation, bias.per_component = OPERATIONS[cfg.operation], cfg.per_component
        bias.value = self.zeros(self.num_worlds, self.size, dtype=wp.float64)
        bias.drawn = self.zeros(self.num_worlds, self.size, dtype=bool)
        self.bias = bias

    def reset(self, mask: wp.array) -> None:
        self.per_element(_begin_bias, mask, self.bias)

    def apply(self, row: wp.array) -> None:
        self.per_element(_add_bias, self.bias, row)


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
            bias[w, i] = ZERO
            if not start_at_zero:
                bias[w, i] = std[i] * normal(episode_rng(clock, w, first_stream), i)
        else:
            keep = wp.exp(-clock.elapsed[w] / time_constant)
            fresh = wp.sqrt(ONE - keep * keep)
            walk = wp.sqrt(clock.elapsed[w])
            bias[w, i] = keep * bias[w, i] + (std[i] * fresh + density[i] * walk) * normal(step_rng(clock, w, stream), i)
    row[w, i] = float(wp.float64(row[w, i]) + bias[w, i])


class _BiasDrift(Effect):
    def initialize(self) -> None:
        cfg = self.cfg
        std, density = (values_of(values, self.size, self.device) for values in (cfg.std, cfg.density))
        bias = self.zeros(self.num_worlds, self.size, dtype=wp.float64)
        self.fixed = (self.stream, self.stream ^ 0x5BD1E995, std, density, cfg.time_constant_s, cfg.start_at_zero, bias)

    def apply(self, row: wp.array) -> None:
        self.per_element(_drift, *self.fixed, row)


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
    if s > ZERO:
        row[w, i] = float(s * wp.round(wp.float64(row[w, i]) / s))


class _Scale(Effect):
    def initialize(self) -> None:
        self.factor = values_of(self.cfg.factor, self.size, self.device)

    def apply(self, row: wp.array) -> None:
        self.per_element(_scale, self.factor, row)


class _Clip(Effect):
    def initialize(self) -> None:
        self.limits = [values_of(values, self.size, self.device) for values in (self.cfg.low, self.cfg.high)]

    def apply(self, row: wp.array) -> None:
        self.per_element(_clip, *self.limits, row)


class _Quantize(Effect):
    def initialize(self) -> None:
        self.step = values_of(self.cfg.step, self.size, self.device)

    def apply(self, row: wp.array) -> None:
        self.per_element(_quantize, self.step, row)


@wp.struct
class Axes:
    """The matrix of each episode that misaligns the axes, and its distribution."""

    stream: wp.uint32
    scale_error: wp.vec3d
    angle: wp.vec3d  # rad
    scale_error_std: wp.float64
    angle_std: wp.float64
    matrix: wp.array(dtype=wp.mat33d)  # [B]
    drawn: wp.array(dtype=bool)  # [B]


@wp.func
def _draw_axes(clock: Clock, axes: Axes, w: int):
    rng = episode_rng(clock, w, axes.stream)
    s = wp.vec3d()
    a = wp.vec3d()
    for k in range(3):
        s[k] = ONE + axes.scale_error[k] + axes.scale_error_std * normal(rng, k)
        a[k] = axes.angle[k] + axes.angle_std * normal(rng, 3 + k)
    cx = wp.cos(a[0])
    sx = wp.sin(a[0])
    cy = wp.cos(a[1])
    sy = wp.sin(a[1])
    cz = wp.cos(a[2])
    sz = wp.sin(a[2])
    # diag(s) Rz Ry Rx
    axes.matrix[w] = wp.mat33d(
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
    axes.drawn[w] = True


@wp.kernel
def _begin_axes(clock: Clock, mask: wp.array(dtype=bool), axes: Axes):
    w = wp.tid()
    if mask[w]:
        _draw_axes(clock, axes, w)


@wp.kernel
def _misalign(clock: Clock, axes: Axes, row: wp.array2d(dtype=float)):
    w = wp.tid()
    if not axes.drawn[w]:
        _draw_axes(clock, axes, w)
    m = axes.matrix[w]
    for k in range(row.shape[1] // 3):
        x = wp.float64(row[w, 3 * k])
        y = wp.float64(row[w, 3 * k + 1])
        z = wp.float64(row[w, 3 * k + 2])
        for i in range(3):
            row[w, 3 * k + i] = float(m[i, 0] * x + m[i, 1] * y + m[i, 2] * z)


class _Misalignment(Effect):
    def initialize(self) -> None:
        cfg, axes = self.cfg, Axes()
        axes.stream, axes.scale_error, axes.angle = self.stream, wp.vec3d(*cfg.scale_error), wp.vec3d(*cfg.angle)
        axes.scale_error_std, axes.angle_std = cfg.scale_error_std, cfg.angle_std
        axes.matrix, axes.drawn = self.zeros(self.num_worlds, dtype=wp.mat33d), self.zeros(self.num_worlds, dtype=bool)
        self.axes = axes

    def reset(self, mask: wp.array) -> None:
        self.per_world(_begin_axes, mask, self.axes)

    def apply(self, row: wp.array) -> None:
        self.per_world(_misalign, self.axes, row)


@wp.kernel
def _find_nan(clock: Clock, sanitize: bool, bad: wp.array(dtype=int), row: wp.array2d(dtype=float)):
    w, i = wp.tid()
    if not wp.isfinite(row[w, i]):
        if sanitize:
            row[w, i] = float(ZERO)
        else:
            wp.atomic_add(bad, w, 1)


class NanPolicy(Effect):
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


EFFECTS: dict[type, type[Effect]] = {
    configs.Noise: _Noise,
    configs.EpisodeBias: _EpisodeBias,
    configs.BiasDrift: _BiasDrift,
    configs.Scale: _Scale,
    configs.Misalignment: _Misalignment,
    configs.Clip: _Clip,
    configs.Quantize: _Quantize,
    configs.NanPolicy: NanPolicy,
}
"""Configuration -> effect."""
