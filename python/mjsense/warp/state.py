# SPDX-License-Identifier: Apache-2.0
"""The state of the worlds: its components, the states in which episodes start, and the fields derived from it."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import warp as wp

from mjsense.warp import arrays
from mjsense.warp.sensor import scalar_view

if TYPE_CHECKING:
    from mjsense.warp.simulation import WarpSimulation

STATE = ("qpos", "qvel", "act", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat", "eq_active", "userdata")
"""Components of the state, except ctrl, whose values for the next step are not those of the physics."""
MEMORY = ("qacc_warmstart", "plastic", "history")
"""Fields of Data that a reset restores as well."""


class Component:
    """A component of the state as an attribute: the live array ``[B, n]``; assignment writes into it."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text + " Live, float32, on the device; call forward() after writing."

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, sim: WarpSimulation | None, owner: type) -> Any:
        return self if sim is None else sim._shared(self._name)

    def __set__(self, sim: WarpSimulation, value: Any) -> None:
        arrays.write(sim._component(self._name), value)


class DerivedFields:
    """Fields of mjData of all worlds at the current state, on the device: ``sim.data.xpos`` is float32 ``[B, nbody, 3]``."""

    def __init__(self, sim: WarpSimulation) -> None:
        self._sim = sim

    def __dir__(self) -> list[str]:
        data = self._sim._data
        return sorted(name for name in vars(data) if isinstance(getattr(data, name), wp.array))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        sim = self._sim
        sim._check_open()
        if name in STATE or name == "ctrl":
            return sim._shared(name)
        array = getattr(sim._data, name, None)
        if not isinstance(array, wp.array):
            near = difflib.get_close_matches(name, dir(self), 3)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise AttributeError(f"mujoco_warp's Data has no array '{name}'{hint}")
        sim._need_forces()
        return arrays.share(scalar_view(array))


def ids_of(world_ids: Any, count: int) -> np.ndarray:
    ids = arrays.on_host(world_ids)
    if ids.dtype == bool:
        if ids.shape != (count,):
            raise ValueError(f"world_ids: a mask of shape {ids.shape} for {count} worlds")
        return np.flatnonzero(ids)
    if ids.size and not np.issubdtype(ids.dtype, np.integer):
        raise TypeError(f"world_ids must be integers or a mask, not {world_ids!r}")
    for world in ids.reshape(-1).tolist():
        if not 0 <= world < count:
            raise ValueError(f"world id {world}: must be in [0, {count})")
    return ids.reshape(-1).astype(np.int64)


def start_states(model: Any, rows: dict[str, wp.array]) -> dict[str, wp.array]:
    """The state components after a reset, ``[1 + nkey, n]``: row 0 is the model's own pose, row 1 + k keyframe k."""
    states: dict[str, list[np.ndarray]] = {name: [] for name in (*STATE, "ctrl")}
    start = mujoco.MjData(model)
    for key in range(-1, model.nkey):
        mujoco.mj_resetDataKeyframe(model, start, key) if key >= 0 else mujoco.mj_resetData(model, start)
        for name, values in states.items():
            values.append(np.array(getattr(start, name)).reshape(-1))
    result = {name: wp.array(np.stack(values), dtype=rows[name].dtype, ndim=2) for name, values in states.items()}
    result |= {name: wp.array(rows[name].numpy()[:1], dtype=rows[name].dtype, ndim=2) for name in MEMORY}
    return result
