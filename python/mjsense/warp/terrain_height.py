# SPDX-License-Identifier: Apache-2.0
"""Terrain height sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from mjsense.warp.rays import Frames, Hits, RayCast, Rays
from mjsense.warp.sensor import Worlds, implements
from mjsense.warp.shapes import NO_HIT
from mjsense.warp.surfaces import Surfaces, nearest_hit

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

wp.set_module_options({"enable_backward": False})

_MIN, _MAX, _MEAN, _NONE = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(3)


@wp.kernel
def _measure_heights(
    surfaces: Surfaces, frames: Frames, rays: Rays, hits: Hits, reduction: int, heights: wp.array2d(dtype=float)
):
    w, f = wp.tid()
    n = rays.count
    pos = frames.pos[w, f]
    any_hit = bool(False)
    for i in range(n):
        any_hit = any_hit or hits.distance[w, f * n + i] >= 0.0
    missing = rays.farthest
    if not any_hit:
        # To the ground straight below, at any distance; without one, to the ground above, which gives 0; else to z = 0.
        down = wp.vec3(0.0, 0.0, -1.0)
        ground = float(0.0)
        below = nearest_hit(surfaces, rays.filter, f, w, pos, down, NO_HIT)
        if below.geom >= 0:
            ground = pos[2] - below.t
        else:
            start = pos + wp.vec3(0.0, 0.0, rays.farthest)
            above = nearest_hit(surfaces, rays.filter, f, w, start, down, NO_HIT)
            if above.geom >= 0:
                ground = start[2] - above.t
        missing = wp.clamp(pos[2] - ground, 0.0, rays.farthest)
    low = float(0.0)
    high = float(0.0)
    total = wp.float64(0.0)
    for i in range(n):
        r = f * n + i
        h = missing
        if hits.distance[w, r] >= 0.0:
            h = pos[2] - hits.pos[w, r][2]
            if hits.normal[w, r][2] < 0.0:
                h = 0.0
        if reduction == _NONE:
            heights[w, r] = h
        if i == 0:
            low = h
            high = h
        low = wp.min(low, h)
        high = wp.max(high, h)
        total += wp.float64(h)
    if reduction == _MIN:
        heights[w, f] = low
    elif reduction == _MAX:
        heights[w, f] = high
    elif reduction == _MEAN:
        heights[w, f] = float(total / wp.float64(n))


@implements("terrain_height")
class TerrainHeight(RayCast):
    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        self.reduction = ["min", "max", "mean", "none"].index(self.cfg.reduction)
        heights = self.fields["heights"]
        self.heights = heights.reshape((worlds.num_worlds, heights.size // worlds.num_worlds))

    def update(self) -> None:
        super().update()
        inputs = [self.scene.surfaces, self.frames, self.rays, self.hits, self.reduction, self.heights]
        self.launch(_measure_heights, (self.worlds.num_worlds, self.num_frames), *inputs)
