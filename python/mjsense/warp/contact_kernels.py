# SPDX-License-Identifier: Apache-2.0
"""Kernels of contact sensors. A thread reads all contacts of one primary in one world, so the number of contacts is not
limited."""

from __future__ import annotations

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

NONE, MINDIST, MAXFORCE, NETFORCE = 0, 1, 2, 3
"""Values of ``Contacts.reduce``."""


@wp.struct
class Contacts:
    """The contacts of all worlds and what a sensor selects of them."""

    counts: wp.array(dtype=wp.int32)
    ends: wp.array(dtype=wp.int32)
    index: wp.array(dtype=wp.int32)
    wrench: wp.array(dtype=wp.spatial_vector)
    dist: wp.array(dtype=wp.float32)
    pos: wp.array(dtype=wp.vec3)
    frame: wp.array(dtype=wp.mat33)
    geom: wp.array(dtype=wp.vec2i)
    body: wp.array(dtype=wp.int32)
    primary: wp.array2d(dtype=wp.uint8)  # [P, ngeom]
    other: wp.array(dtype=wp.uint8)  # [1 + ngeom], first that of a flex
    num_slots: int
    reduce: int
    world_axes: bool


@wp.struct
class Rows:
    """The fields of a sensor; those that are not requested are empty. The shape of N columns is ``[B, N]``."""

    found: wp.array2d(dtype=wp.float32)
    force: wp.array2d(dtype=wp.vec3)
    torque: wp.array2d(dtype=wp.vec3)
    dist: wp.array2d(dtype=wp.float32)
    pos: wp.array2d(dtype=wp.vec3)
    normal: wp.array2d(dtype=wp.vec3)
    tangent: wp.array2d(dtype=wp.vec3)
    normal_force: wp.array2d(dtype=wp.vec3)
    friction_force: wp.array2d(dtype=wp.vec3)
    other_geom: wp.array2d(dtype=wp.int32)
    other_body: wp.array2d(dtype=wp.int32)


@wp.struct
class Selection:
    """The contacts of each primary: those of its slots, in order, and the strongest one; with netforce the sums."""

    count: wp.array2d(dtype=wp.int32)  # [B, P]
    slot: wp.array2d(dtype=wp.int32)  # [B, P * S]
    sign: wp.array2d(dtype=wp.int32)
    key: wp.array2d(dtype=wp.float32)
    peak_norm: wp.array2d(dtype=wp.float32)  # [B, P]
    peak_force: wp.array2d(dtype=wp.vec3)
    peak_dist: wp.array2d(dtype=wp.float32)
    peak_pos: wp.array2d(dtype=wp.vec3)


@wp.func
def side(contacts: Contacts, c: int, p: int) -> int:
    """+1 if the primary is geom 1 of the contact, -1 if it is geom 2, 0 if the contact does not count."""
    g1 = contacts.geom[c][0]
    g2 = contacts.geom[c][1]
    if g1 >= 0:
        if contacts.primary[p, g1] != wp.uint8(0) and contacts.other[g2 + 1] != wp.uint8(0):
            return 1
    if g2 >= 0:
        if contacts.primary[p, g2] != wp.uint8(0) and contacts.other[g1 + 1] != wp.uint8(0):
            return -1
    return 0


@wp.func
def to_axes(contacts: Contacts, c: int, sign: float, v: wp.vec3) -> wp.vec3:
    """A force or torque of geom 1 on geom 2 as that of the primary: in world axes, or in the contact frame of the primary."""
    if contacts.world_axes:
        return sign * (wp.transpose(contacts.frame[c]) * v)
    # The frame of geom 2 is (-n, -t, n x t): only the third component of the opposite vector is flipped.
    return wp.vec3(v[0], v[1], sign * v[2])


@wp.struct
class Sum:
    """The sum of the wrenches of a primary's contacts. Arms and moments are about the first contact, for the precision of
    float32."""

    origin: wp.vec3  # m, world
    force: wp.vec3
    normal_force: wp.vec3
    moment: wp.vec3
    weight: float  # N, sum of the magnitudes of the forces
    weighted_arm: wp.vec3  # N m


@wp.func
def _add(total: Sum, contacts: Contacts, c: int, sign: float) -> Sum:
    f = wp.spatial_top(contacts.wrench[c])
    norm = wp.length(f)
    axes = wp.transpose(contacts.frame[c])
    arm = contacts.pos[c] - total.origin
    force = sign * (axes * f)
    total.force = total.force + force
    total.normal_force = total.normal_force + sign * (axes * wp.vec3(f[0], 0.0, 0.0))
    total.moment = total.moment + (sign * (axes * wp.spatial_bottom(contacts.wrench[c])) + wp.cross(arm, force))
    total.weighted_arm = total.weighted_arm + norm * arm
    total.weight = total.weight + norm
    return total


@wp.func
def _insert(contacts: Contacts, selection: Selection, w: int, p: int, count: int, c: int, sign: int, norm: float):
    """Keeps contact number ``count`` of a primary in the order of the reduction, if it is one of the first ``num_slots``."""
    S = contacts.num_slots
    key = float(0.0)
    if contacts.reduce == wp.static(MINDIST):
        key = contacts.dist[c]
    elif contacts.reduce == wp.static(MAXFORCE):
        key = -norm
    first = p * S
    k = wp.min(count, S)
    if k < S or key < selection.key[w, first + S - 1]:
        k = wp.min(k, S - 1)
        while k > 0 and key < selection.key[w, first + k - 1]:
            selection.key[w, first + k] = selection.key[w, first + k - 1]
            selection.slot[w, first + k] = selection.slot[w, first + k - 1]
            selection.sign[w, first + k] = selection.sign[w, first + k - 1]
            k -= 1
        selection.key[w, first + k] = key
        selection.slot[w, first + k] = c
        selection.sign[w, first + k] = sign


@wp.struct
class Row:
    """The values of one slot."""

    found: float
    dist: float
    pos: wp.vec3
    normal: wp.vec3
    tangent: wp.vec3
    force: wp.vec3
    torque: wp.vec3
    normal_force: wp.vec3
    friction_force: wp.vec3


@wp.func
def _row_of_contact(contacts: Contacts, c: int, sign: float) -> Row:
    f = wp.spatial_top(contacts.wrench[c])
    axes = wp.transpose(contacts.frame[c])
    row = Row()
    row.dist = contacts.dist[c]
    row.pos = contacts.pos[c]
    row.normal = sign * (axes * wp.vec3(1.0, 0.0, 0.0))
    row.tangent = sign * (axes * wp.vec3(0.0, 1.0, 0.0))
    row.force = to_axes(contacts, c, sign, f)
    row.torque = to_axes(contacts, c, sign, wp.spatial_bottom(contacts.wrench[c]))
    row.normal_force = to_axes(contacts, c, sign, wp.vec3(f[0], 0.0, 0.0))
    row.friction_force = to_axes(contacts, c, sign, wp.vec3(0.0, f[1], f[2]))
    return row


@wp.func
def _row_of_sum(total: Sum) -> Row:
    """The net force at the mean position of the contacts, weighted by their forces. World axes."""
    row = Row()
    arm = wp.vec3(0.0)
    if total.weight > 0.0:
        arm = total.weighted_arm / total.weight
        row.pos = total.origin + arm
    row.normal = wp.vec3(1.0, 0.0, 0.0)
    row.tangent = wp.vec3(0.0, 1.0, 0.0)
    row.force = total.force
    row.torque = total.moment - wp.cross(arm, total.force)
    row.normal_force = total.normal_force
    row.friction_force = total.force - total.normal_force
    return row


@wp.func
def _put(field: wp.array2d(dtype=Any), w: int, n: int, value: Any):
    """Writes to a field if the sensor has it."""
    if field.shape[0] > 0:
        field[w, n] = value


@wp.func
def _write(contacts: Contacts, rows: Rows, w: int, n: int, row: Row, geom: int):
    _put(rows.found, w, n, row.found)
    _put(rows.dist, w, n, row.dist)
    _put(rows.pos, w, n, row.pos)
    _put(rows.normal, w, n, row.normal)
    _put(rows.tangent, w, n, row.tangent)
    _put(rows.force, w, n, row.force)
    _put(rows.torque, w, n, row.torque)
    _put(rows.normal_force, w, n, row.normal_force)
    _put(rows.friction_force, w, n, row.friction_force)
    if rows.other_geom.shape[0] > 0:
        body = int(-1)
        if geom >= 0:
            body = contacts.body[geom]
        rows.other_geom[w, n] = geom
        rows.other_body[w, n] = body


@wp.func
def _write_peak(contacts: Contacts, selection: Selection, w: int, p: int, total: Sum, strongest: int, sign: float, norm: float):
    """The force that the latch compares: the net force, or that of the strongest contact."""
    if contacts.reduce == wp.static(NETFORCE):
        selection.peak_norm[w, p] = wp.length(total.force)
        selection.peak_force[w, p] = total.force
        selection.peak_dist[w, p] = 0.0
        selection.peak_pos[w, p] = wp.vec3(0.0)
        if total.weight > 0.0:
            selection.peak_pos[w, p] = total.origin + total.weighted_arm / total.weight
    else:
        selection.peak_norm[w, p] = norm
        selection.peak_force[w, p] = to_axes(contacts, strongest, sign, wp.spatial_top(contacts.wrench[strongest]))
        selection.peak_dist[w, p] = contacts.dist[strongest]
        selection.peak_pos[w, p] = contacts.pos[strongest]


@wp.kernel
def read(contacts: Contacts, selection: Selection, rows: Rows):
    w, p = wp.tid()
    net = contacts.reduce == wp.static(NETFORCE)
    begin = contacts.ends[w] - contacts.counts[w]
    count = int(0)
    total = Sum()
    strongest = int(-1)
    strongest_sign = float(1.0)
    strongest_norm = float(-1.0)
    for i in range(contacts.counts[w]):
        c = contacts.index[begin + i]
        sign = side(contacts, c, p)
        if sign != 0:
            norm = wp.length(wp.spatial_top(contacts.wrench[c]))
            if norm > strongest_norm:
                strongest, strongest_sign, strongest_norm = c, float(sign), norm
            if net:
                if count == 0:
                    total.origin = contacts.pos[c]
                total = _add(total, contacts, c, float(sign))
            else:
                _insert(contacts, selection, w, p, count, c, sign, norm)
            count += 1
    selection.count[w, p] = count
    for k in range(contacts.num_slots):
        n = p * contacts.num_slots + k
        row = Row()
        geom = int(-1)
        if k < count and (k == 0 or not net):
            chosen = strongest
            sign_of_chosen = strongest_sign
            if net:
                row = _row_of_sum(total)
            else:
                chosen = selection.slot[w, n]
                sign_of_chosen = float(selection.sign[w, n])
                row = _row_of_contact(contacts, chosen, sign_of_chosen)
            row.found = float(count)
            geom = contacts.geom[chosen][1]
            if sign_of_chosen < 0.0:
                geom = contacts.geom[chosen][0]
        _write(contacts, rows, w, n, row, geom)
    if selection.peak_norm.shape[0] > 0 and count > 0:
        _write_peak(contacts, selection, w, p, total, strongest, strongest_sign, strongest_norm)


@wp.kernel
def read_pairs(
    contacts: Contacts,
    secondary: wp.array2d(dtype=wp.uint8),
    found: wp.array3d(dtype=wp.float32),
    force: wp.array3d(dtype=wp.vec3),
):
    """Counts and net forces of each primary and secondary, world axes."""
    w, p, s = wp.tid()
    begin = contacts.ends[w] - contacts.counts[w]
    count = int(0)
    total = wp.vec3(0.0)
    for i in range(contacts.counts[w]):
        c = contacts.index[begin + i]
        g1 = contacts.geom[c][0]
        g2 = contacts.geom[c][1]
        if g1 >= 0 and g2 >= 0:
            sign = float(0.0)
            if contacts.primary[p, g1] != wp.uint8(0) and secondary[s, g2] != wp.uint8(0):
                sign = 1.0
            elif contacts.primary[p, g2] != wp.uint8(0) and secondary[s, g1] != wp.uint8(0):
                sign = -1.0
            if sign != 0.0:
                count += 1
                total += sign * (wp.transpose(contacts.frame[c]) * wp.spatial_top(contacts.wrench[c]))
    found[w, p, s] = float(count)
    force[w, p, s] = total


@wp.kernel
def copy_columns(source: wp.array2d(dtype=wp.float32), begin: int, target: wp.array2d(dtype=wp.float32)):
    w, i = wp.tid()
    target[w, i] = source[w, begin + i]
