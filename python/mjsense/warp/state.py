# SPDX-License-Identifier: Apache-2.0
"""The state of the worlds: its components, the states in which episodes start, and the fields derived from it."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import warp as wp

from mjsense.core.errors import did_you_mean
from mjsense.warp import arrays
from mjsense.warp.sensor import scalar_view

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

    def __get__(self, sim: Any, owner: type) -> Any:
        return self if sim is None else sim._shared(self._name)

    def __set__(self, sim: Any, value: Any) -> None:
        array = sim._component(self._name)
        shape = tuple(value.shape) if hasattr(value, "shape") else np.shape(value)
        try:
            fits = np.broadcast_shapes(shape, array.shape) == tuple(array.shape)
        except ValueError:
            fits = False
        if not fits:
            raise ValueError(f"{self._name}: shape {shape} does not broadcast to {tuple(array.shape)}")
        arrays.write(array, value)


class DerivedFields:
    """Fields of mjData of all worlds at the current state, on the device: ``sim.data.xpos`` is float32 ``[B, nbody, 3]``."""

    def __init__(self, sim: Any) -> None:
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
            raise AttributeError(f"mujoco_warp's Data has no array '{name}'{did_you_mean(name, dir(self))}")
        sim._sensors.need_forces()
        return arrays.share(scalar_view(array))


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
