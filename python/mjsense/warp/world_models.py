# SPDX-License-Identifier: Apache-2.0
"""Models that differ between worlds."""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from mjsense import _core
from mjsense.core.errors import did_you_mean
from mjsense.warp import physics

_SET_CONST = tuple(
    """
    body_subtreemass geom_aabb geom_rbound tendon_length0 eq_data cam_pos0 cam_poscom0 cam_mat0 light_pos0 light_poscom0
    light_dir0 dof_invweight0 body_invweight0 tendon_invweight0 actuator_acc0
    """.split()
)
"""Fields of the model that mujoco_warp.set_const computes, and that need a row per world then."""


class WorldModels:
    """The fields of mujoco_warp's model, which are shared by the worlds until they differ.

    Args:
        changed: Called when an array was replaced.
    """

    def __init__(self, model: mjw.Model, data: mjw.Data, device: Any, changed: Callable[[], None]) -> None:
        self._model, self._data, self._device, self._changed = model, data, device, changed

    def array(self, field: str) -> wp.array:
        """The array of a field that can differ between worlds, with the leading dimension 1 or B."""
        by_world = _fields()
        if field not in by_world:
            raise ValueError(
                f"{field}: not a field of the model that can differ between worlds with "
                f"backend='warp'{did_you_mean(field, by_world)} "
                f"There are {', '.join(by_world)}"
            )
        return getattr(self._model, field)

    def by_world(self, field: str) -> wp.array:
        """The array of a field, with a row for each world."""
        array, worlds = getattr(self._model, field), self._data.nworld
        if array.shape[0] != worlds:
            rows = np.repeat(array.numpy()[:1], worlds, axis=0)
            array = wp.array(rows, dtype=array.dtype, device=self._device)
            setattr(self._model, field, array)
            self._changed()
        return array

    def write(self, field: str, values: np.ndarray, rows: np.ndarray) -> None:
        """Sets a field in these worlds and computes the fields that depend on it."""
        with wp.ScopedDevice(self._device):
            array = self.by_world(field)
            host = array.numpy()
            host[rows] = values.reshape(host[rows].shape)
            array.assign(host)
            physics.place_fixed_geoms(field, self._model, self._data)
            if field in _core.setconst_inputs():
                for name in _SET_CONST:
                    if hasattr(self._model, name):
                        self.by_world(name)
                mjw.set_const(self._model, self._data)


def _fields() -> list[str]:
    """Floating-point fields of mujoco_warp's model that can have a row per world."""
    hints = typing.get_type_hints(mjw.Model, include_extras=True)
    names = []
    for name, hint in hints.items():
        shape, dtype = getattr(hint, "shape", ()), getattr(hint, "dtype", None)
        scalar = getattr(dtype, "_wp_scalar_type_", dtype)
        if shape and shape[0] == "*" and scalar in (float, wp.float32) and hasattr(mujoco.MjModel, name):
            names.append(name)
    return sorted(names)
