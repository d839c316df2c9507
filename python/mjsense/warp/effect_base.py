# SPDX-License-Identifier: Apache-2.0
"""What effects have in common: the time at which a row is measured, distributions, and the base class."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from mjsense.sensors import effects as configs
from mjsense.warp.random import Rng, make_rng, normal, uniform

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the arithmetic of the C++ library, bit for bit

GAUSSIAN, UNIFORM = wp.constant(0), wp.constant(1)
ADD, SCALE = wp.constant(0), wp.constant(1)
OPERATIONS = {"add": 0, "scale": 1, "abs": 2}
ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))
ROW_TYPES = (wp.float32, wp.int32, wp.uint8, wp.bool)
"""Types of the elements of a row."""


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
    started: wp.array(dtype=wp.int64)  # [B] tick at which the episode began
    advance: wp.array(dtype=bool)  # [B] false: this tick's row is measured again
    elapsed: wp.array(dtype=wp.float64)  # [B] s since the previous row


@wp.func
def step_rng(clock: Clock, w: int, stream: wp.uint32) -> Rng:
    return make_rng(clock.seed[0], clock.key[w], stream, clock.tick[w])


@wp.func
def episode_rng(clock: Clock, w: int, stream: wp.uint32) -> Rng:
    return make_rng(clock.seed[0], clock.key[w], stream, clock.episode[w])


@wp.struct
class Draw:
    """A distribution: mean and standard deviation, bounds, or a constant; one value for each component."""

    kind: int
    a: wp.array(dtype=wp.float64)
    b: wp.array(dtype=wp.float64)


@wp.func
def sample(draw: Draw, rng: Rng, i: int, n: int) -> wp.float64:
    """Component ``i``, from number ``n`` of the stream."""
    if draw.kind == GAUSSIAN:
        return draw.a[i] + draw.b[i] * normal(rng, n)
    if draw.kind == UNIFORM:
        return draw.a[i] + (draw.b[i] - draw.a[i]) * uniform(rng, n)
    return draw.a[i]


@wp.func
def operate(operation: int, x: wp.float64, e: wp.float64) -> wp.float64:
    if operation == ADD:
        return x + e
    if operation == SCALE:
        return x * e
    return e


def values_of(values: Any, size: int, device: Any) -> wp.array:
    """One float64 for each component."""
    return wp.array(np.broadcast_to(np.asarray(values, np.float64), (size,)).copy(), dtype=wp.float64, device=device)


def draw_of(cfg: Any, size: int, device: Any) -> Draw:
    draw = Draw()
    if isinstance(cfg, configs.Gaussian):
        draw.kind, first, second = 0, cfg.mean, cfg.std
    elif isinstance(cfg, configs.Uniform):
        draw.kind, first, second = 1, cfg.low, cfg.high
    else:
        draw.kind, first, second = 2, cfg.value if isinstance(cfg, configs.Constant) else cfg, 0.0
    draw.a, draw.b = values_of(first, size, device), values_of(second, size, device)
    return draw


class Effect:
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
