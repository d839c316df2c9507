# SPDX-License-Identifier: Apache-2.0
"""Kernels over the state of all worlds: invalid numbers, resets and clocks."""

from __future__ import annotations

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

STALE = 1 << 30
"""Bit of the status: the state was written, and derived quantities were not computed again."""
OVERFLOW = 1 << 29
"""Bit of the status: contacts or constraints were left out."""


@wp.kernel
def flag_overflow(
    errors: int,
    njmax: int,
    naconmax: int,
    rows: wp.array(dtype=wp.int32),
    contacts: wp.array(dtype=wp.int32),
    pairs: wp.array(dtype=wp.int32),
    overflow: wp.array(dtype=wp.int32),
    status: wp.array(dtype=wp.int32),
):
    world = wp.tid()
    if rows[world] > njmax or contacts[0] > naconmax or pairs[0] > naconmax or (overflow[world] & errors) != 0:
        status[world] = status[world] | wp.static(OVERFLOW)


@wp.kernel
def flag_invalid(values: wp.array2d(dtype=wp.float32), bit: int, status: wp.array(dtype=wp.int32)):
    """Sets the bit of worlds with NaN, infinity or a number beyond MuJoCo's limit of 1e10."""
    world, i = wp.tid()
    x = values[world, i]
    if not (wp.abs(x) <= 1.0e10):
        wp.atomic_or(status, world, bit)


@wp.kernel
def flag_changed(values: wp.array2d(dtype=wp.float32), known: wp.array2d(dtype=wp.float32), status: wp.array(dtype=wp.int32)):
    world, i = wp.tid()
    if values[world, i] != known[world, i]:
        wp.atomic_or(status, world, wp.static(STALE))


@wp.kernel
def failed_worlds(status: wp.array(dtype=wp.int32), mask: wp.array(dtype=wp.bool)):
    """The worlds whose state contains invalid numbers."""
    world = wp.tid()
    mask[world] = (status[world] & wp.static(OVERFLOW - 1)) != 0


@wp.kernel
def rekey(
    mask: wp.array(dtype=wp.bool),
    keys: wp.array(dtype=wp.uint32),
    key: wp.array(dtype=wp.uint32),
    tick: wp.array(dtype=wp.int64),
    episode: wp.array(dtype=wp.int64),
):
    """Random numbers of the worlds of the mask are from now on those of these keys, with clocks from 0."""
    world = wp.tid()
    if mask[world]:
        key[world] = keys[world]
        tick[world] = wp.int64(0)
        episode[world] = wp.int64(0)


@wp.kernel
def copy_rows(
    mask: wp.array(dtype=wp.bool), row: wp.array(dtype=wp.int32), source: wp.array2d(dtype=Any), target: wp.array2d(dtype=Any)
):
    """Row ``row[w]`` of the source, modulo its number of rows, for the worlds of the mask."""
    world, i = wp.tid()
    if mask[world]:
        target[world, i] = source[row[world] % source.shape[0], i]


@wp.kernel
def copy_qpos0(
    mask: wp.array(dtype=wp.bool),
    row: wp.array(dtype=wp.int32),
    qpos0: wp.array2d(dtype=wp.float32),
    qpos: wp.array2d(dtype=wp.float32),
):
    """The model's own pose, which may differ between worlds, for the worlds of the mask that start from it."""
    world, i = wp.tid()
    if mask[world] and row[world] == 0:
        qpos[world, i] = qpos0[world % qpos0.shape[0], i]


@wp.kernel
def begin_episode(
    mask: wp.array(dtype=wp.bool),
    row: wp.array(dtype=wp.int32),
    start_times: wp.array(dtype=wp.float64),
    substep: wp.array(dtype=wp.int64),
    episode: wp.array(dtype=wp.int64),
    first: wp.array(dtype=wp.bool),
    start: wp.array(dtype=wp.float64),
    time: wp.array(dtype=wp.float32),
):
    world = wp.tid()
    if mask[world]:
        substep[world] = wp.int64(0)
        episode[world] = episode[world] + wp.int64(1)
        first[world] = True
        start[world] = start_times[row[world]]
        time[world] = wp.float32(start[world])


@wp.kernel
def advance_clocks(
    dt: wp.float64,
    substep: wp.array(dtype=wp.int64),
    tick: wp.array(dtype=wp.int64),
    first: wp.array(dtype=wp.bool),
    start: wp.array(dtype=wp.float64),
    time: wp.array(dtype=wp.float32),
):
    """Counts a physics step. The time is a multiple of the timestep and does not accumulate rounding errors."""
    world = wp.tid()
    substep[world] = substep[world] + wp.int64(1)
    tick[world] = tick[world] + wp.int64(1)
    first[world] = False
    time[world] = wp.float32(start[world] + wp.float64(substep[world]) * dt)


@wp.kernel
def times(dt: wp.float64, substep: wp.array(dtype=wp.int64), start: wp.array(dtype=wp.float64), time: wp.array(dtype=wp.float64)):
    world = wp.tid()
    time[world] = start[world] + wp.float64(substep[world]) * dt


@wp.kernel
def set_times(
    mask: wp.array(dtype=wp.bool),
    dt: wp.float64,
    substep: wp.array(dtype=wp.int64),
    time: wp.array(dtype=wp.float64),
    start: wp.array(dtype=wp.float64),
    physics_time: wp.array(dtype=wp.float32),
):
    """The inverse of times(), for the worlds of the mask."""
    world = wp.tid()
    if mask[world]:
        start[world] = time[world] - wp.float64(substep[world]) * dt
        physics_time[world] = wp.float32(time[world])
