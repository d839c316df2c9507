# SPDX-License-Identifier: Apache-2.0
"""Contact sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from mjsense import _core
from mjsense.core import mujoco_names
from mjsense.warp import contact_memory
from mjsense.warp.contact_kernels import (
    MAXFORCE,
    MINDIST,
    NETFORCE,
    NONE,
    Contacts,
    Rows,
    Selection,
    copy_columns,
    read,
    read_pairs,
)
from mjsense.warp.contact_lists import ContactLists
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, declared, implements, rows_view, vec3_view

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

_REDUCE = {"none": NONE, "mindist": MINDIST, "maxforce": MAXFORCE, "netforce": NETFORCE}


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
        wp.launch(read, self._shape, [self._contacts, self._selection, self._rows])
        if self._secondary is not None:
            found, force = self.fields["pair_found"], vec3_view(self.fields["pair_force"])
            wp.launch(read_pairs, (*self._shape, self._secondary.shape[0]), [self._contacts, self._secondary, found, force])

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
        self.inputs, self.needs = (owner,), owner.needs
        self.fields = declared(worlds, sensor)
        (self._target,) = self.fields.values()
        self._source = rows_view(owner.fields[field])
        self._begin = primary * self._target.shape[1]

    def update(self) -> None:
        wp.launch(copy_columns, self._target.shape, [self._source, self._begin, self._target])


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
        cfg.latch
        or cfg.friction_split
        or cfg.secondary_policy == "each"
        or cfg.reduce == "netforce"
        or (strongest and cfg.other_ids)
        or any(field in ("force", "torque") or (field != "found" and strongest) for field in cfg.fields)
    )


def _members(model: Any, match: Any, names: tuple[str, ...]) -> np.ndarray:
    """Which geoms belong to each of the matched elements, bool ``[len(names), ngeom]``."""
    geoms = match.mode == "geom"
    kind = mujoco_names.Obj.GEOM if geoms else mujoco_names.Obj.BODY
    rows = []
    for name in names:
        full = f"{match.entity}/{name}" if match.entity and match.entity != "terrain" else name
        index = mujoco_names.name2id(model, kind, full)
        if geoms:
            rows.append(np.arange(model.ngeom) == index)
        elif match.mode == "body":
            rows.append(model.geom_bodyid == index)
        else:
            rows.append(mujoco_names.bodies_below(model, index)[model.geom_bodyid])
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
    contacts.reduce = _REDUCE[cfg.reduce] if needs == Stage.ACC or cfg.reduce != "maxforce" else NONE
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
