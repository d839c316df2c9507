# SPDX-License-Identifier: Apache-2.0
"""Memory for contacts and constraints, and the errors when it does not suffice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np


@dataclass
class Limits:
    nconmax: int
    """Contacts of a world, on average over the worlds."""
    njmax: int
    """Constraint rows of a world."""


def sizes(model: Any, nconmax: int | None, njmax: int | None) -> Limits:
    """The given limits, or estimates: twice the contacts of the start state but at least 48, and the rows of these contacts
    together with those of all limits, equality constraints and friction losses."""
    start = mujoco.MjData(model)
    mujoco.mj_forward(model, start)
    if nconmax is None:
        nconmax = max(48, 2 * int(start.ncon))
        if model.nhfield or model.nflex:
            nconmax = max(nconmax, 256)
    if njmax is None:
        fixed: int = (
            6 * model.neq
            + int((model.dof_frictionloss > 0).sum())
            + 2 * int(model.jnt_limited.sum())
            + 2 * int(model.tendon_limited.sum())
        )
        rows = 4 if model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL else 3
        if model.ngeom and int(model.geom_condim.max()) > 3:
            rows = 2 * (int(model.geom_condim.max()) - 1) if rows == 4 else int(model.geom_condim.max())
        njmax = max(fixed + rows * nconmax, 2 * int(start.nefc))
    return Limits(int(nconmax), int(njmax))


_TOO_MANY = {
    mjw.OverflowType.NJMAX_NNZ: "the constraint Jacobian has too many entries that are not zero: raise njmax",
    mjw.OverflowType.CCD: "too many pairs of convex geoms: raise nconmax",
    mjw.OverflowType.HFIELD: "a geom touches too many triangles of a height field: use a coarser one",
    mjw.OverflowType.EPA_HORIZON: "the collision of two convex geoms has too many faces: use simpler meshes",
    mjw.OverflowType.TACTILE: "too many collision pairs of a tactile sensor",
}

ERRORS = int(mjw.OverflowType.NEFC | mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE) | sum(
    int(kind) for kind in _TOO_MANY
)
"""Bits of Data.overflow that are errors. Others, such as the limit of the solver's iterations, are not."""


def check_overflow(data: mjw.Data, limits: Limits) -> None:
    """Raises RuntimeError, with the world and the limit to raise, if contacts or constraints of the last step were left out."""
    rows = data.nefc.numpy()
    worlds = np.flatnonzero(rows > limits.njmax)
    if len(worlds):
        world = worlds[np.argmax(rows[worlds])]
        _fail(f"world {world} has {rows[world]} constraint rows, and njmax is {limits.njmax}", f"njmax={2 * rows[world]}")
    contacts, found = int(data.nacon.numpy()[0]), int(data.ncollision.numpy()[0])
    if max(contacts, found) > data.naconmax:
        counts = np.bincount(data.contact.worldid.numpy()[: min(contacts, data.naconmax)], minlength=data.nworld)
        most = f"most of them in world {int(counts.argmax())}" if contacts else "before their exact test"
        _fail(
            f"there are {max(contacts, found)} contacts or pairs of close geoms in all worlds, {most}, and nconmax "
            f"is {limits.nconmax} "
            f"({data.naconmax} in all worlds)",
            f"nconmax={2 * -(-max(contacts, found) // data.nworld)}",
        )
    overflow = data.overflow.numpy() & ERRORS
    # Within a step more rows may have been needed than at its end.
    for world in np.flatnonzero(overflow).tolist():
        bits = int(overflow[world])
        if bits & mjw.OverflowType.NEFC:
            _fail(f"world {world} had more constraint rows than njmax, {limits.njmax}, in a substep", f"njmax={2 * limits.njmax}")
        if bits & (mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE):
            _fail(
                f"there were more contacts than nconmax, {limits.nconmax}, allows in a substep", f"nconmax={2 * limits.nconmax}"
            )
        for kind, text in _TOO_MANY.items():
            if bits & kind:
                raise RuntimeError(f"world {world}: {text}. The results of this step are incomplete")


def _fail(what: str, option: str) -> None:
    raise RuntimeError(f"{what}: contacts or constraints of this step were left out. Make the simulation with {option} or more")
