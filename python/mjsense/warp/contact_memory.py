# SPDX-License-Identifier: Apache-2.0
"""State that a contact sensor keeps from substep to substep: air and contact times, events, the latch over a control step,
history."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import warp as wp

from mjsense.warp.sensor import Worlds, vec3_view

wp.set_module_options({"enable_backward": False})

_UNKNOWN, _AIR, _CONTACT = 0, 1, 2


@wp.struct
class State:
    """Arrays ``[B, P]``. Those that are not requested are empty."""

    dt: wp.float64
    decimation: int
    substep: wp.array2d(dtype=wp.int32)  # index in the control step
    elapsed: wp.array2d(dtype=wp.float64)  # s since the control step began
    since: wp.array2d(dtype=wp.float64)  # s in contact if > 0, in the air if < 0
    touch: wp.array2d(dtype=wp.int32)  # at the last substep
    peak: wp.array2d(dtype=wp.float32)  # maximum force of the control step; -1 without contact
    current_air_time: wp.array2d(dtype=wp.float32)
    last_air_time: wp.array2d(dtype=wp.float32)
    current_contact_time: wp.array2d(dtype=wp.float32)
    last_contact_time: wp.array2d(dtype=wp.float32)
    touchdown: wp.array2d(dtype=wp.bool)
    liftoff: wp.array2d(dtype=wp.bool)
    found_any: wp.array2d(dtype=wp.bool)
    first_touch_time: wp.array2d(dtype=wp.float32)
    dist_at_peak: wp.array2d(dtype=wp.float32)
    force_peak: wp.array2d(dtype=wp.vec3)
    pos_at_peak: wp.array2d(dtype=wp.vec3)


@wp.func
def _clear_step(state: State, w: int, p: int):
    state.elapsed[w, p] = wp.float64(0.0)
    if state.touchdown.shape[0] > 0:
        state.touchdown[w, p] = False
        state.liftoff[w, p] = False
    if state.found_any.shape[0] > 0:
        state.found_any[w, p] = False
        state.first_touch_time[w, p] = -1.0
        state.dist_at_peak[w, p] = 0.0
        state.force_peak[w, p] = wp.vec3(0.0)
        state.pos_at_peak[w, p] = wp.vec3(0.0)
        state.peak[w, p] = -1.0


@wp.kernel
def _substep(
    state: State,
    count: wp.array2d(dtype=wp.int32),
    norm: wp.array2d(dtype=wp.float32),
    force: wp.array2d(dtype=wp.vec3),
    dist: wp.array2d(dtype=wp.float32),
    pos: wp.array2d(dtype=wp.vec3),
):
    """``norm`` and so on are those of the strongest contact of this substep."""
    w, p = wp.tid()
    if state.substep[w, p] == 0:
        _clear_step(state, w, p)
    state.substep[w, p] = (state.substep[w, p] + 1) % state.decimation
    state.elapsed[w, p] = state.elapsed[w, p] + state.dt
    zero = wp.float64(0.0)
    touching = count[w, p] > 0
    if state.since.shape[0] > 0:
        t = state.since[w, p]
        if touching:
            if t < zero:
                state.last_air_time[w, p] = wp.float32(state.dt - t)
            t = wp.max(t, zero) + state.dt
        else:
            if t > zero:
                state.last_contact_time[w, p] = wp.float32(t + state.dt)
            t = wp.min(t, zero) - state.dt
        state.since[w, p] = t
        state.current_air_time[w, p] = wp.float32(wp.max(-t, zero))
        state.current_contact_time[w, p] = wp.float32(wp.max(t, zero))
    if state.touchdown.shape[0] > 0:
        before = state.touch[w, p]
        now = wp.static(_AIR)
        if touching:
            now = wp.static(_CONTACT)
        if touching and before == wp.static(_AIR):
            state.touchdown[w, p] = True
        if not touching and before == wp.static(_CONTACT):
            state.liftoff[w, p] = True
        state.touch[w, p] = now
    if state.found_any.shape[0] > 0 and touching:
        state.found_any[w, p] = True
        if state.first_touch_time[w, p] < 0.0:
            state.first_touch_time[w, p] = wp.float32(state.elapsed[w, p])
        if norm[w, p] > state.peak[w, p]:
            state.peak[w, p] = norm[w, p]
            state.force_peak[w, p] = force[w, p]
            state.dist_at_peak[w, p] = dist[w, p]
            state.pos_at_peak[w, p] = pos[w, p]


@wp.kernel
def _reset(mask: wp.array(dtype=wp.bool), state: State):
    w, p = wp.tid()
    if mask[w]:
        state.substep[w, p] = 0
        _clear_step(state, w, p)
        if state.since.shape[0] > 0:
            state.since[w, p] = wp.float64(0.0)
            state.current_air_time[w, p] = 0.0
            state.last_air_time[w, p] = 0.0
            state.current_contact_time[w, p] = 0.0
            state.last_contact_time[w, p] = 0.0
        if state.touchdown.shape[0] > 0:
            state.touch[w, p] = wp.static(_UNKNOWN)


@wp.kernel
def _push(values: wp.array3d(dtype=wp.float32), history: wp.array4d(dtype=wp.float32)):
    """Adds the newest values ``[B, N, dim]`` at the front of ``[B, N, H, dim]``."""
    w, n, i = wp.tid()
    h = history.shape[2] - 1
    while h > 0:
        history[w, n, h, i] = history[w, n, h - 1, i]
        h -= 1
    history[w, n, 0, i] = values[w, n, i]


@wp.kernel
def _clear(mask: wp.array(dtype=wp.bool), history: wp.array2d(dtype=wp.float32)):
    w, i = wp.tid()
    if mask[w]:
        history[w, i] = 0.0


class Memory:
    def __init__(self, worlds: Worlds, fields: Mapping[str, wp.array], cfg: Any, count: wp.array, selection: Any) -> None:
        shape = count.shape
        self._count, self._selection = count, selection
        self._state = state = State()
        state.dt, state.decimation = worlds.physics_dt, worlds.decimation
        state.substep, state.elapsed = worlds.zeros(shape, wp.int32), worlds.zeros(shape, wp.float64)
        for name in State.vars:
            if name in fields:
                setattr(state, name, fields[name] if fields[name].ndim == 2 else vec3_view(fields[name]))
        # The timers stay 0 without the field found, as in mjlab.
        if cfg.track_air_time and "found" in cfg.fields:
            state.since = worlds.zeros(shape, wp.float64)
        if cfg.track_events:
            state.touch = worlds.zeros(shape, wp.int32)
        if cfg.latch:
            state.peak = worlds.zeros(shape, wp.float32)
        self._histories = []
        for name, history in fields.items():
            if name.endswith("_history"):
                values = fields[name.removesuffix("_history")]
                B, N, H = history.shape[:3]
                dim = 3 if history.ndim == 4 else 1
                self._histories.append(
                    (values.reshape((B, N, dim)), history.reshape((B, N, H, dim)), history.reshape((B, N * H * dim)))
                )
        self._everything = worlds.array([True] * worlds.num_worlds, wp.bool)
        self.reset(self._everything)

    def substep(self) -> None:
        s = self._selection
        wp.launch(_substep, self._count.shape, [self._state, self._count, s.peak_norm, s.peak_force, s.peak_dist, s.peak_pos])
        for values, history, _ in self._histories:
            wp.launch(_push, values.shape, [values, history])

    def reset(self, mask: wp.array) -> None:
        wp.launch(_reset, self._count.shape, [mask, self._state])
        for _, _, rows in self._histories:
            wp.launch(_clear, rows.shape, [mask, rows])
