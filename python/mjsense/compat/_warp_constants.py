# SPDX-License-Identifier: Apache-2.0
"""What mujoco_warp's ``set_const`` derives, and where mjsense derives the same."""

from __future__ import annotations

from typing import Any

import mujoco_warp

_FIXED = ("body_subtreemass",)
_BOUNDS = ("geom_aabb", "geom_rbound", "geom_size")  # of mujoco_warp 4.0
_KINEMATICS = (
    "tendon_length0",
    "eq_data",
    *("cam_pos0", "cam_poscom0", "cam_mat0"),
    *("light_pos0", "light_poscom0", "light_dir0"),
)
_INERTIA = ("dof_invweight0", "body_invweight0", "tendon_invweight0", "actuator_acc0")


def fields_of(name: str, groups: int | None) -> tuple[str, ...]:
    """What this function of mujoco_warp derives; `groups` of its version 4.0."""
    if groups is not None:  # SetConstGroup
        parts = ((1, (*_FIXED, *_BOUNDS)), (2, _KINEMATICS), (4, _INERTIA))
        return tuple(field for bit, part in parts if groups & bit for field in part)
    bounds = _BOUNDS if hasattr(mujoco_warp, "SetConstGroup") else ()
    fixed, zero = (*_FIXED, *bounds), (*_KINEMATICS, *_INERTIA)
    return {"set_const_fixed": fixed, "set_const_0": zero}.get(name, (*fixed, *zero))


def has_placeholders(name: str, model: Any) -> bool:
    """Whether an actuator has a damping ratio, or a tendon no spring length, which mujoco_warp's function would replace."""
    if hasattr(mujoco_warp, "SetConstGroup"):
        return False
    ratio = model.actuator_biasprm.size and (model.actuator_biasprm.numpy()[..., 2] > 0).any()
    springs = name == "set_const" and model.tendon_lengthspring.size and (model.tendon_lengthspring.numpy() < 0).any()
    return bool(name != "set_const_fixed" and (ratio or springs))
