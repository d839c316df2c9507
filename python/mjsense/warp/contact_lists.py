# SPDX-License-Identifier: Apache-2.0
"""The contacts of each world, in an order that does not depend on the device: by bodies, geoms and the number of the contact."""

from __future__ import annotations

from typing import Any

import mujoco_warp as mjw
import warp as wp
from mujoco_warp._src import types

from mjsense.warp.sensor import Stage, WarpSensor, Worlds

wp.set_module_options({"enable_backward": False})


@wp.kernel
def _count(
    room: int,
    total: wp.array(dtype=wp.int32),
    kind: wp.array(dtype=wp.int32),
    world: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    last: wp.array(dtype=wp.int32),
    previous: wp.array(dtype=wp.int32),
):
    """Counts the contacts of each world, and links them in a list that ends at ``last``."""
    c = wp.tid()
    if c < wp.min(total[0], room) and (kind[c] & wp.static(int(types.ContactType.CONSTRAINT))) != 0:
        wp.atomic_add(counts, world[c], 1)
        previous[c] = wp.atomic_exch(last, world[c], c)


@wp.func
def _before(
    a: int, b: int, geoms: wp.array(dtype=wp.vec2i), number: wp.array(dtype=wp.int32), body: wp.array(dtype=wp.int32)
) -> bool:
    a1, a2, b1, b2 = int(0), int(0), int(0), int(0)
    if geoms[a][0] >= 0:
        a1 = body[geoms[a][0]]
    if geoms[a][1] >= 0:
        a2 = body[geoms[a][1]]
    if geoms[b][0] >= 0:
        b1 = body[geoms[b][0]]
    if geoms[b][1] >= 0:
        b2 = body[geoms[b][1]]
    if wp.min(a1, a2) != wp.min(b1, b2):
        return wp.min(a1, a2) < wp.min(b1, b2)
    if wp.max(a1, a2) != wp.max(b1, b2):
        return wp.max(a1, a2) < wp.max(b1, b2)
    if geoms[a][0] != geoms[b][0]:
        return geoms[a][0] < geoms[b][0]
    if geoms[a][1] != geoms[b][1]:
        return geoms[a][1] < geoms[b][1]
    if number[a] != number[b]:
        return number[a] < number[b]
    return a < b


@wp.kernel
def _sort(
    geoms: wp.array(dtype=wp.vec2i),
    number: wp.array(dtype=wp.int32),
    body: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    ends: wp.array(dtype=wp.int32),
    last: wp.array(dtype=wp.int32),
    previous: wp.array(dtype=wp.int32),
    index: wp.array(dtype=wp.int32),
):
    """Writes the sorted list of a world into its part of ``index``."""
    world = wp.tid()
    begin = ends[world] - counts[world]
    contact = last[world]
    filled = int(0)
    while contact >= 0:
        k = begin + filled
        while k > begin and _before(contact, index[k - 1], geoms, number, body):
            index[k] = index[k - 1]
            k -= 1
        index[k] = contact
        filled += 1
        contact = previous[contact]


class ContactLists(WarpSensor):
    """Shared by all contact sensors. Contact ``i`` of world ``w`` is ``index[ends[w] - counts[w] + i]``."""

    def __init__(self, worlds: Worlds) -> None:
        self.worlds, self.name, self.cfg, self.fields = worlds, "(contacts)", None, {}
        room = worlds.data.naconmax
        self.counts = worlds.zeros(worlds.num_worlds, wp.int32)
        self.ends = worlds.zeros(worlds.num_worlds, wp.int32)
        self.index = worlds.zeros(room, wp.int32)
        self._last = worlds.zeros(worlds.num_worlds, wp.int32)
        self._previous = worlds.zeros(room, wp.int32)
        self._ids = worlds.array(range(room), wp.int32)
        self._body = worlds.array(worlds.compiled.model.geom_bodyid, wp.int32)
        self.wrench = worlds.zeros(room, wp.spatial_vector)
        """Force and torque of each contact in its frame, of geom 1 on geom 2, if a sensor needs it."""

    @classmethod
    def of(cls, worlds: Worlds) -> ContactLists:
        """The lists of this simulation; they are made for the first sensor that needs them."""
        if "contacts" not in worlds.shared:
            lists = worlds.shared["contacts"] = cls(worlds)
            worlds.sensors[lists.name] = lists
        return worlds.shared["contacts"]

    def update(self) -> None:
        contact: Any = self.worlds.data.contact
        B, room = self.worlds.num_worlds, self.index.shape[0]
        self.counts.zero_()
        self._last.fill_(-1)
        total = self.worlds.data.nacon
        wp.launch(_count, room, [room, total, contact.type, contact.worldid, self.counts, self._last, self._previous])
        wp.utils.array_scan(self.counts, self.ends, inclusive=True)
        wp.launch(
            _sort,
            B,
            [contact.geom, contact.geomcollisionid, self._body, self.counts, self.ends, self._last, self._previous, self.index],
        )
        if self.needs == Stage.ACC:
            mjw.contact_force(self.worlds.model, self.worlds.data, self._ids, False, self.wrench)

    def substep(self) -> None:
        self.update()
