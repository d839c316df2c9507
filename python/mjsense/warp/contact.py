# SPDX-License-Identifier: Apache-2.0
"""Contact sensors. A thread reads all contacts of one primary in one world, so the number of contacts is not limited."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from mjsense import _core, _mujoco
from mjsense.warp import contact_memory
from mjsense.warp.contact_lists import ContactLists
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, declared, implements, vec3_view

if TYPE_CHECKING:
    from mjsense.native_sensor import NativeSensor

wp.set_module_options({"enable_backward": False})

_NONE, _MINDIST, _MAXFORCE, _NETFORCE = 0, 1, 2, 3
_REDUCE = {"none": _NONE, "mindist": _MINDIST, "maxforce": _MAXFORCE, "netforce": _NETFORCE}


@wp.struct
class Contacts:
    """The contacts of all worlds and what a sensor selects of them."""

    counts: wp.array(dtype=wp.int32)  # type: ignore[valid-type]
    ends: wp.array(dtype=wp.int32)  # type: ignore[valid-type]
    index: wp.array(dtype=wp.int32)  # type: ignore[valid-type]
    wrench: wp.array(dtype=wp.spatial_vector)  # type: ignore[valid-type]
    dist: wp.array(dtype=wp.float32)  # type: ignore[valid-type]
    pos: wp.array(dtype=wp.vec3)  # type: ignore[valid-type]
    frame: wp.array(dtype=wp.mat33)  # type: ignore[valid-type]
    geom: wp.array(dtype=wp.vec2i)  # type: ignore[valid-type]
    body: wp.array(dtype=wp.int32)  # type: ignore[valid-type]
    primary: wp.array2d(dtype=wp.uint8)  # type: ignore[valid-type]  # [P, ngeom]
    other: wp.array(dtype=wp.uint8)  # type: ignore[valid-type]  # [1 + ngeom], first that of a flex
    num_slots: int
    reduce: int
    world_axes: bool


@wp.struct
class Rows:
    """The fields of a sensor; those that are not requested are empty. The shape of N columns is ``[B, N]``."""

    found: wp.array2d(dtype=wp.float32)  # type: ignore[valid-type]
    force: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    torque: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    dist: wp.array2d(dtype=wp.float32)  # type: ignore[valid-type]
    pos: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    normal: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    tangent: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    normal_force: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    friction_force: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    other_geom: wp.array2d(dtype=wp.int32)  # type: ignore[valid-type]
    other_body: wp.array2d(dtype=wp.int32)  # type: ignore[valid-type]


@wp.struct
class Selection:
    """The contacts of each primary: those of its slots, in order, and the strongest one; with netforce the sums."""

    count: wp.array2d(dtype=wp.int32)  # type: ignore[valid-type]  # [B, P]
    slot: wp.array2d(dtype=wp.int32)  # type: ignore[valid-type]  # [B, P * S]
    sign: wp.array2d(dtype=wp.int32)  # type: ignore[valid-type]
    key: wp.array2d(dtype=wp.float32)  # type: ignore[valid-type]
    peak_norm: wp.array2d(dtype=wp.float32)  # type: ignore[valid-type]  # [B, P]
    peak_force: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]
    peak_dist: wp.array2d(dtype=wp.float32)  # type: ignore[valid-type]
    peak_pos: wp.array2d(dtype=wp.vec3)  # type: ignore[valid-type]


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


@wp.kernel
def _read(contacts: Contacts, selection: Selection, rows: Rows):
    w, p = wp.tid()
    S = contacts.num_slots
    begin = contacts.ends[w] - contacts.counts[w]
    count = int(0)
    weight = float(0.0)
    origin = wp.vec3(0.0)
    weighted_pos = wp.vec3(0.0)
    force = wp.vec3(0.0)
    normal_force = wp.vec3(0.0)
    moment = wp.vec3(0.0)
    strongest = int(-1)
    strongest_sign = float(1.0)
    strongest_norm = float(-1.0)
    for i in range(contacts.counts[w]):
        c = contacts.index[begin + i]
        sign = side(contacts, c, p)
        if sign != 0:
            f = wp.spatial_top(contacts.wrench[c])
            norm = wp.length(f)
            if norm > strongest_norm:
                strongest, strongest_sign, strongest_norm = c, float(sign), norm
            if contacts.reduce == wp.static(_NETFORCE):
                if count == 0:
                    origin = contacts.pos[c]
                axes = wp.transpose(contacts.frame[c])
                arm = contacts.pos[c] - origin
                pull = float(sign) * (axes * f)
                force += pull
                normal_force += float(sign) * (axes * wp.vec3(f[0], 0.0, 0.0))
                moment += float(sign) * (axes * wp.spatial_bottom(contacts.wrench[c])) + wp.cross(arm, pull)
                weighted_pos += norm * arm
                weight += norm
            else:
                key = float(0.0)
                if contacts.reduce == wp.static(_MINDIST):
                    key = contacts.dist[c]
                elif contacts.reduce == wp.static(_MAXFORCE):
                    key = -norm
                k = wp.min(count, S)
                first = p * S
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
            count += 1
    selection.count[w, p] = count
    net = contacts.reduce == wp.static(_NETFORCE)
    for k in range(S):
        n = p * S + k
        filled = k < count and (k == 0 or not net)
        found = float(0.0)
        dist = float(0.0)
        pos = wp.vec3(0.0)
        normal = wp.vec3(0.0)
        tangent = wp.vec3(0.0)
        pull = wp.vec3(0.0)
        torque = wp.vec3(0.0)
        along = wp.vec3(0.0)
        across = wp.vec3(0.0)
        geom = int(-1)
        if filled:
            found = float(count)
            chosen = strongest
            towards = strongest_sign
            if net:
                lever = wp.vec3(0.0)
                if weight > 0.0:
                    lever = weighted_pos / weight
                    pos = origin + lever
                pull = force
                torque = moment - wp.cross(lever, force)
                along = normal_force
                across = force - normal_force
                normal = wp.vec3(1.0, 0.0, 0.0)
                tangent = wp.vec3(0.0, 1.0, 0.0)
            else:
                chosen = selection.slot[w, n]
                towards = float(selection.sign[w, n])
                g = wp.spatial_top(contacts.wrench[chosen])
                turn = wp.transpose(contacts.frame[chosen])
                dist = contacts.dist[chosen]
                pos = contacts.pos[chosen]
                normal = towards * (turn * wp.vec3(1.0, 0.0, 0.0))
                tangent = towards * (turn * wp.vec3(0.0, 1.0, 0.0))
                pull = to_axes(contacts, chosen, towards, g)
                torque = to_axes(contacts, chosen, towards, wp.spatial_bottom(contacts.wrench[chosen]))
                along = to_axes(contacts, chosen, towards, wp.vec3(g[0], 0.0, 0.0))
                across = to_axes(contacts, chosen, towards, wp.vec3(0.0, g[1], g[2]))
            geom = contacts.geom[chosen][1]
            if towards < 0.0:
                geom = contacts.geom[chosen][0]
        if rows.found.shape[0] > 0:
            rows.found[w, n] = found
        if rows.dist.shape[0] > 0:
            rows.dist[w, n] = dist
        if rows.pos.shape[0] > 0:
            rows.pos[w, n] = pos
        if rows.normal.shape[0] > 0:
            rows.normal[w, n] = normal
        if rows.tangent.shape[0] > 0:
            rows.tangent[w, n] = tangent
        if rows.force.shape[0] > 0:
            rows.force[w, n] = pull
        if rows.torque.shape[0] > 0:
            rows.torque[w, n] = torque
        if rows.normal_force.shape[0] > 0:
            rows.normal_force[w, n] = along
        if rows.friction_force.shape[0] > 0:
            rows.friction_force[w, n] = across
        if rows.other_geom.shape[0] > 0:
            rows.other_geom[w, n] = geom
            body = int(-1)
            if geom >= 0:
                body = contacts.body[geom]
            rows.other_body[w, n] = body
    if selection.peak_norm.shape[0] > 0 and count > 0:
        if net:
            selection.peak_norm[w, p] = wp.length(force)
            selection.peak_force[w, p] = force
            selection.peak_dist[w, p] = 0.0
            selection.peak_pos[w, p] = wp.vec3(0.0)
            if weight > 0.0:
                selection.peak_pos[w, p] = origin + weighted_pos / weight
        else:
            selection.peak_norm[w, p] = strongest_norm
            selection.peak_force[w, p] = to_axes(contacts, strongest, strongest_sign, wp.spatial_top(contacts.wrench[strongest]))
            selection.peak_dist[w, p] = contacts.dist[strongest]
            selection.peak_pos[w, p] = contacts.pos[strongest]


@wp.kernel
def _read_pairs(
    contacts: Contacts,
    secondary: wp.array2d(dtype=wp.uint8),
    found: wp.array3d(dtype=wp.float32),
    force: wp.array3d(dtype=wp.vec3),
):  # type: ignore[valid-type]
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


@implements("contact")
class Contact(WarpSensor):
    substep_fills_rows = True

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        cfg, model = sensor.cfg, worlds.compiled.model
        self.fields = declared(worlds, sensor)
        self.wants_substep = cfg.track_air_time or cfg.history_length > 0 or cfg.track_events or cfg.latch
        self.needs = Stage.ACC if _needs_forces(cfg) else Stage.POS
        self.inputs = (lists := ContactLists.of(worlds),)
        lists.needs = max(lists.needs, self.needs)
        lists.wants_substep |= self.wants_substep
        self.primary_names = _core.contact_primary_names(sensor._handle)
        primary = _members(model, cfg.primary, self.primary_names)
        names = _core.contact_secondary_names(sensor._handle)
        secondary = _members(model, cfg.secondary, names) if names else None
        self._shape = (worlds.num_worlds, len(primary))
        for name in ("other_geom", "other_body"):
            if name in self.fields:
                self.fields[name].fill_(-1)
        self._contacts = _contacts(worlds, lists, cfg, primary, secondary, self.needs)
        self._rows = _rows(self.fields)
        self._selection = _selection(worlds, len(primary), cfg.num_slots, cfg.latch)
        self._secondary = worlds.array(secondary, wp.uint8) if cfg.secondary_policy == "each" and secondary is not None else None
        self._memory = contact_memory.Memory(worlds, self.fields, cfg, self._selection.count, self._selection)

    def update(self) -> None:
        wp.launch(_read, self._shape, [self._contacts, self._selection, self._rows])
        if self._secondary is not None:
            found, force = self.fields["pair_found"], vec3_view(self.fields["pair_force"])
            wp.launch(_read_pairs, (*self._shape, self._secondary.shape[0]), [self._contacts, self._secondary, found, force])

    def substep(self) -> None:
        self.update()
        self._memory.substep()

    def reset(self, mask: wp.array) -> None:
        self._memory.reset(mask)


@implements("contact_field")
class ContactField(WarpSensor):
    """One field of one primary: the contact sensor's columns."""

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        owner, primary, field = owner_of(worlds, sensor.name)
        slots = owner.cfg.num_slots
        self.inputs, self.needs = (owner,), owner.needs
        columns = owner.fields[field][:, primary * slots : (primary + 1) * slots]
        (name,) = sensor.specs
        # A view would have more dimensions than the field on the CPU, [B, S * dim].
        self._source, self._target = columns, declared(worlds, sensor)[name]
        self.fields = {name: self._target}

    def update(self) -> None:
        shape = self._source.shape
        wp.copy(self._target.reshape(shape), self._source)


def has_field(worlds: Worlds, name: str) -> bool:
    """Whether the field is in the contact frame, as that of the sensor '<sensor>_<primary>_<field>' must be."""
    owner, _, field = owner_of(worlds, name)
    return not owner.cfg.global_frame or field not in ("force", "torque")


def owner_of(worlds: Worlds, name: str) -> tuple[Contact, int, str]:
    """The contact sensor, the primary and the field of a sensor '<sensor>_<primary>_<field>'."""
    for owner in worlds.sensors.values():
        if isinstance(owner, Contact):
            for p, primary in enumerate(owner.primary_names):
                for field in owner.cfg.fields:
                    if name == f"{owner.name}_{primary}_{field}":
                        return owner, p, field
    raise KeyError(name)


def _needs_forces(cfg: Any) -> bool:
    """As ContactSensor::needs() in C++."""
    strongest = cfg.reduce == "maxforce"
    return (
        cfg.latch or cfg.friction_split or cfg.secondary_policy == "each" or cfg.reduce == "netforce" or (strongest and cfg.other_ids)
        or any(field in ("force", "torque") or (field != "found" and strongest) for field in cfg.fields)
    )  # fmt: skip


def _members(model: Any, match: Any, names: tuple[str, ...]) -> np.ndarray:
    """Which geoms belong to each of the matched elements, bool ``[len(names), ngeom]``."""
    geoms = match.mode == "geom"
    kind = _mujoco.Obj.GEOM if geoms else _mujoco.Obj.BODY
    rows = []
    for name in names:
        full = f"{match.entity}/{name}" if match.entity and match.entity != "terrain" else name
        index = _mujoco.name2id(model, kind, full)
        if geoms:
            rows.append(np.arange(model.ngeom) == index)
        elif match.mode == "body":
            rows.append(model.geom_bodyid == index)
        else:
            inside = np.arange(model.nbody) == index
            for body in range(index + 1, model.nbody):
                inside[body] |= inside[model.body_parentid[body]]
            rows.append(inside[model.geom_bodyid])
    return np.array(rows, np.uint8).reshape(len(names), model.ngeom)


def _contacts(
    worlds: Worlds, lists: ContactLists, cfg: Any, primary: np.ndarray, secondary: np.ndarray | None, needs: Stage
) -> Contacts:
    model, source = worlds.compiled.model, worlds.data.contact
    contacts = Contacts()
    contacts.counts, contacts.ends, contacts.index, contacts.wrench = lists.counts, lists.ends, lists.index, lists.wrench
    contacts.dist, contacts.pos, contacts.frame, contacts.geom = source.dist, source.pos, source.frame, source.geom
    contacts.body = worlds.array(model.geom_bodyid, wp.int32)
    contacts.primary = worlds.array(primary, wp.uint8)
    accepted = np.ones(model.ngeom + 1) if secondary is None else np.concatenate([[0], secondary.any(0)])
    contacts.other = worlds.array(accepted.astype(np.uint8), wp.uint8)
    contacts.num_slots = cfg.num_slots
    contacts.reduce = _REDUCE[cfg.reduce] if needs == Stage.ACC or cfg.reduce != "maxforce" else _NONE
    contacts.world_axes = bool(cfg.global_frame)
    return contacts


def _rows(fields: Any) -> Rows:
    rows = Rows()
    for name in Rows.vars:
        if name in fields:
            setattr(rows, name, fields[name] if fields[name].ndim == 2 else vec3_view(fields[name]))
    return rows


def _selection(worlds: Worlds, num_primaries: int, num_slots: int, latch: bool) -> Selection:
    selection = Selection()
    B, N = worlds.num_worlds, num_primaries * num_slots
    selection.count = worlds.zeros((B, num_primaries), wp.int32)
    selection.slot, selection.sign = worlds.zeros((B, N), wp.int32), worlds.zeros((B, N), wp.int32)
    selection.key = worlds.zeros((B, N), wp.float32)
    if latch:
        selection.peak_norm, selection.peak_dist = (worlds.zeros((B, num_primaries), wp.float32) for _ in range(2))
        selection.peak_force, selection.peak_pos = (worlds.zeros((B, num_primaries), wp.vec3) for _ in range(2))
    return selection
