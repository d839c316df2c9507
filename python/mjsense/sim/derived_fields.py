# SPDX-License-Identifier: Apache-2.0
"""Fields of mjData of all worlds."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from mjsense.scene.written_values import write_component

STATE = ("qpos", "qvel", "act", "ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat", "eq_active", "userdata")


class Owner(Protocol):
    """The part of a simulation that is read here."""

    num_worlds: int
    _core: Any
    _derived: dict[str, tuple[Any, np.ndarray]]

    def _component(self, name: str) -> np.ndarray: ...


class DerivedFields:
    """Fields of mjData of all worlds at the current state: ``sim.data.xpos`` is float64 ``[B, nbody, 3]``.

    Like sensor data, the arrays are read-only and overwritten by the next read after a change. A field is copied only when it is
    read.
    """

    _sim: Owner
    # Declared for editors and type checkers; all other fields of mjData are available too and listed by dir().
    xpos: np.ndarray
    xquat: np.ndarray
    xmat: np.ndarray
    xipos: np.ndarray
    geom_xpos: np.ndarray
    geom_xmat: np.ndarray
    site_xpos: np.ndarray
    site_xmat: np.ndarray
    cam_xpos: np.ndarray
    cam_xmat: np.ndarray
    subtree_com: np.ndarray
    """Centre of mass of each body and its descendants, m, world frame ``[B, nbody, 3]``. In a scene with terrain body 1 is the
    terrain: use ``sim.model.body("robot/base").id``."""
    cvel: np.ndarray
    qacc: np.ndarray
    qfrc_bias: np.ndarray
    qfrc_passive: np.ndarray
    qfrc_actuator: np.ndarray
    qfrc_constraint: np.ndarray
    actuator_length: np.ndarray
    actuator_velocity: np.ndarray
    actuator_force: np.ndarray
    ten_length: np.ndarray
    sensordata: np.ndarray
    cfrc_ext: np.ndarray

    def __init__(self, sim: Owner) -> None:
        object.__setattr__(self, "_sim", sim)

    def __repr__(self) -> str:
        return f"<mjData of {self._sim.num_worlds} worlds: .xpos, .sensordata ..., computed when read>"

    def __dir__(self) -> list[str]:
        return sorted({*STATE, *self._sim._core.derived_fields()})

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in STATE:
            raise AttributeError(f"mjData.{name} is computed from the state: write {', '.join(STATE[:4])} ...")
        write_component(name, self._sim._component(name), value)

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):
            raise AttributeError(name)
        sim = self._sim
        if name in STATE:
            return sim._component(name)
        if name not in sim._derived:
            try:
                handle = sim._core.derived_field(name)
            except KeyError as error:
                raise AttributeError(str(error)) from None
            sim._derived[name] = handle, handle.arrays()[""]
        handle, array = sim._derived[name]
        sim._core.refresh(handle)
        return array.view()
