# SPDX-License-Identifier: Apache-2.0
"""The targets of an entity's actuators, and the controls that follow from them."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mjsense.compat.mjlab._tensors import ids, tensor
from mjsense.core import mujoco_names

NAMES = (
    "joint_pos_target",
    "joint_vel_target",
    "joint_effort_target",
    "tendon_len_target",
    "tendon_vel_target",
    "tendon_effort_target",
    "site_effort_target",
)
"""As in mjlab, by kind of element and what is wanted of it."""


class Targets:
    """Float64 arrays ``[B, elements]`` with the names of ``NAMES``, 0 at first and after ``clear()``."""

    def __init__(self, entity: Any, model: Any, num_worlds: int) -> None:
        names = {"joint": entity.joint_names, "tendon": entity.tendon_names, "site": entity.site_names}
        local = {}
        for kind, of in names.items():
            number = getattr(mujoco_names.Obj, kind.upper())
            local[kind] = {mujoco_names.name2id(model, number, f"{entity.native.name}/{name}"): i for i, name in enumerate(of)}
        self.arrays = {name: np.zeros((num_worlds, len(names[name.partition("_")[0]]))) for name in NAMES}
        self._tensors = {name: tensor(array) for name, array in self.arrays.items()}
        self._controls: dict[str, list[tuple[int, int]]] = {}
        """Pairs of a control of the model and an element, by the name of the target."""
        for name in entity.actuator_names:
            actuator = mujoco_names.name2id(model, mujoco_names.Obj.ACTUATOR, f"{entity.native.name}/{name}")
            of = _target_of(model, actuator)
            element = local.get(of.partition("_")[0], {}).get(int(model.actuator_trnid[actuator][0]))
            if of in self.arrays and element is not None:
                self._controls.setdefault(of, []).append((actuator, element))

    def __getitem__(self, name: str) -> Any:
        return self._tensors[name]

    def clear(self, env_ids: Any = None) -> None:
        rows = ids(env_ids)
        for array in self.arrays.values():
            array[slice(None) if rows is None else rows] = 0

    def write(self, ctrl: Any, like: Any) -> None:
        """Writes the targets to the controls of the actuators. like(values, ctrl) converts them."""
        for name, pairs in self._controls.items():
            controls, elements = (list(numbers) for numbers in zip(*pairs))
            ctrl[:, controls] = like(self._tensors[name][:, elements], ctrl)


def _target_of(model: Any, actuator: int) -> str:
    """The target that an actuator follows, by its transmission and its force: joint_pos_target."""
    transmissions = {
        mujoco.mjtTrn.mjTRN_JOINT: "joint",
        mujoco.mjtTrn.mjTRN_JOINTINPARENT: "joint",
        mujoco.mjtTrn.mjTRN_TENDON: "tendon",
        mujoco.mjtTrn.mjTRN_SITE: "site",
    }
    kind = transmissions.get(mujoco.mjtTrn(int(model.actuator_trntype[actuator])), "")
    wanted = "effort"
    if model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE:
        _, stiffness, damping = model.actuator_biasprm[actuator][:3]
        wanted = ("len" if kind == "tendon" else "pos") if stiffness else "vel" if damping else "effort"
    return f"{kind}_{wanted}_target"


__all__ = ["NAMES", "Targets"]
