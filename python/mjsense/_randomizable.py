# SPDX-License-Identifier: Apache-2.0
"""Fields of the model that may differ between worlds, and the values that they may have."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense import _mujoco

_IDS = {"geom_matid": "nmat", "flex_matid": "nmat", "mat_texid": "ntex"}
"""Model fields that contain ids which sensors resolve, and the mjModel size that bounds each."""
_WHOLE = {
    "geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_group", "geom_matid", "geom_castshadow",
    "geom_dataid", "site_group", "site_matid", "jnt_group", "jnt_limited", "jnt_actfrclimited", "jnt_actgravcomp",
    "light_active", "light_castshadow", "light_type", "cam_projection", "flex_contype", "flex_conaffinity", "flex_condim",
    "flex_priority", "flex_group", "flex_matid", "flex_selfcollide", "skin_group", "skin_matid", "mat_texid",
    "mat_texuniform", "eq_active0", "tendon_group", "tendon_matid", "tendon_limited", "tendon_actfrclimited",
    "actuator_group", "actuator_ctrllimited", "actuator_forcelimited", "actuator_actlimited", "actuator_actearly",
    "geom_type",
}  # fmt: skip
"""Integer and boolean model fields that may differ between worlds. All others are sizes and addresses, which MuJoCo uses to index
memory."""
_FIXED = {
    "actuator_delay", "sensor_delay", "sensor_interval", "efm0_L", "bvh_aabb", "oct_aabb", "oct_coeff", "numeric_data",
    "tuple_objprm",
}  # fmt: skip
"""Floating-point model fields that may not differ between worlds: buffer sizes and data structures depend on them."""


def check_randomizable(model: Any, field: str) -> None:
    """Raises ValueError for a field that is the same in all worlds."""
    like = getattr(model, field, None)
    if not isinstance(like, np.ndarray):
        return  # Simulation.model_field() reports the available fields
    real = like.dtype.kind == "f"
    if (real and field in _FIXED) or (not real and field not in _WHOLE):
        raise ValueError(f"{field}: part of the model's structure, which is the same in all worlds")


def valid_values(model: Any, field: str, values: Any, like: np.ndarray, worlds: np.ndarray) -> np.ndarray:
    """Values of a model field with the shape and dtype of `like`, a row for each of these worlds."""
    try:
        values = np.broadcast_to(np.asarray(values, like.dtype), like.shape)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{field}: values must be of shape {like.shape} or broadcast to it: {error}") from None
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        world, *element = np.argwhere(~np.isfinite(values))[0].tolist()
        place = f"that of world {worlds[world]}, element {element}"
        raise ValueError(f"{field}: values must be finite numbers; {place} is {values[(world, *element)]}")
    if field.endswith("_condim") and not np.isin(values, (1, 3, 4, 6)).all():
        raise ValueError(f"{field}: values must be 1, 3, 4 or 6")
    if field in ("geom_type", "light_type", "cam_projection"):
        _check_types(model, field, values)
    if field == "geom_dataid":
        meshes = model.geom_type == _mujoco.Geom.MESH
        fits = np.where(meshes, (values >= 0) & (values < model.nmesh), values == model.geom_dataid)
        if not fits.all():
            raise ValueError(
                f"geom_dataid: ids of meshes, 0 to {model.nmesh - 1}, for geoms that are meshes; the others keep theirs"
            )
    if field in _IDS:
        count = getattr(model, _IDS[field])
        if (values < -1).any() or (values >= count).any():
            raise ValueError(f"{field}: ids from {values.min()} to {values.max()}; the model's are 0 to {count - 1}, -1 is none")
    if field.endswith("quat") and values.size and (norms := np.linalg.norm(values, axis=-1)).min() < 1e-12:
        world, *element = np.argwhere(norms < 1e-12)[0].tolist()
        raise ValueError(f"{field}: values must be quaternions; that of world {worlds[world]}, element {element}, has length 0")
    return values


def _check_types(model: Any, field: str, values: np.ndarray) -> None:
    """Geom types may change to other primitives; meshes, height fields and signed distance fields cannot change."""
    if field == "geom_type":
        kinds = _mujoco.Geom
        primitives = [kinds.PLANE, kinds.SPHERE, kinds.CAPSULE, kinds.ELLIPSOID, kinds.CYLINDER, kinds.BOX]
        fits = (values == model.geom_type) | (np.isin(values, primitives) & np.isin(model.geom_type, primitives))
    else:
        fits = (values >= 0) & (values <= (1 if field == "cam_projection" else 3))
    if not fits.all():
        raise ValueError(f"{field}: {np.unique(values[~fits]).tolist()} cannot be given here")
