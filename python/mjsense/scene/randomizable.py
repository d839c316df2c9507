# SPDX-License-Identifier: Apache-2.0
"""Fields of the model that may differ between worlds, and the values that they may have."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.core import mujoco_names
from mjsense.scene.physics_options import PREFIX, check_option, check_option_values, option_values
from mjsense.scene.written_values import numbers

_IDS = {
    "geom_matid": "nmat",
    "site_matid": "nmat",
    "flex_matid": "nmat",
    "skin_matid": "nmat",
    "tendon_matid": "nmat",
    "mat_texid": "ntex",
}
"""Model fields that contain ids which sensors resolve, and the mjModel size that bounds each."""
_WHOLE = set(
    """
    geom_contype geom_conaffinity geom_condim geom_priority geom_group geom_matid geom_castshadow geom_dataid site_group
    site_matid jnt_group jnt_limited jnt_actfrclimited jnt_actgravcomp light_active light_castshadow light_type cam_projection
    flex_contype flex_conaffinity flex_condim flex_priority flex_group flex_matid flex_selfcollide skin_group skin_matid
    mat_texid mat_texuniform eq_active0 tendon_group tendon_matid tendon_limited tendon_actfrclimited actuator_group
    actuator_ctrllimited actuator_forcelimited actuator_actlimited actuator_actearly geom_type
    """.split()
)
"""Integer and boolean model fields that may differ between worlds. All others are sizes and addresses, which MuJoCo uses to index
memory."""
_FIXED = {
    "actuator_delay",
    "sensor_delay",
    "sensor_interval",
    "efm0_L",
    "bvh_aabb",
    "oct_aabb",
    "oct_coeff",
    "numeric_data",
    "tuple_objprm",
}
"""Floating-point model fields that may not differ between worlds: buffer sizes and data structures depend on them."""

_NOT_NEGATIVE = {"body_mass", "body_inertia", "geom_size", "site_size"}


def field_of(model: Any, field: str) -> Any:
    """A field of the model, or an option, ``opt.gravity``, as an array; None if there is no such array."""
    if not field.startswith(PREFIX):
        return getattr(model, field, None)
    value = getattr(model.opt, field.removeprefix(PREFIX), None)
    return (
        np.array(value, np.int32 if isinstance(value, int) else np.float64)
        if isinstance(value, (int, float, np.ndarray))
        else None
    )


def is_randomizable(model: Any, field: str) -> bool:
    """Whether worlds can have their own values of this field."""
    try:
        check_randomizable(model, field)
    except ValueError:
        return False
    return isinstance(field_of(model, field), np.ndarray)


def check_randomizable(model: Any, field: str) -> None:
    """Raises ValueError for a field that is the same in all worlds."""
    if field.startswith(PREFIX):
        return check_option(field.removeprefix(PREFIX))
    like = getattr(model, field, None)
    if not isinstance(like, np.ndarray):
        return  # Simulation.model_field() reports the available fields
    if not (field not in _FIXED if like.dtype.kind == "f" else field in _WHOLE):
        raise ValueError(f"{field}: part of the model's structure, which is the same in all worlds")


def valid_values(model: Any, field: str, values: Any, like: np.ndarray, worlds: np.ndarray) -> np.ndarray:
    """Values of a model field with the shape and dtype of `like`, a row for each of these worlds."""
    option = field.removeprefix(PREFIX) if field.startswith(PREFIX) else ""
    given = numbers(field, option_values(option, values) if option else values)
    with np.errstate(invalid="ignore"):  # NaN has no integer
        typed = given.astype(like.dtype)
    if like.dtype.kind in "iu" and (different := typed != given).any():
        raise ValueError(f"{field}: values must be integers, not {given[different][0]}")
    try:
        values = np.broadcast_to(typed, like.shape)
    except ValueError:
        raise ValueError(f"{field}: shape {given.shape} does not broadcast to {like.shape}") from None
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        place, value = _first(~np.isfinite(values), values, worlds)
        raise ValueError(f"{field}: values must be finite numbers; {place} is {value}")
    if option:
        check_option_values(option, values, field_of(model, field))
    if field in _NOT_NEGATIVE and (values < 0).any():
        place, value = _first(values < 0, values, worlds)
        raise ValueError(f"{field}: values must be at least 0; {place} is {value}")
    if field.endswith("_condim") and not np.isin(values, (1, 3, 4, 6)).all():
        raise ValueError(f"{field}: values must be 1, 3, 4 or 6")
    if field in ("geom_type", "light_type", "cam_projection"):
        _check_types(model, field, values)
    if field == "geom_dataid":
        meshes = model.geom_type == mujoco_names.Geom.MESH
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
        place, _ = _first(norms < 1e-12, norms, worlds)
        raise ValueError(f"{field}: values must be quaternions; {place}, has length 0")
    return values


def _first(wrong: np.ndarray, values: np.ndarray, worlds: np.ndarray) -> tuple[str, Any]:
    """The place of the first of the wrong values, for messages, and the value."""
    world, *element = np.argwhere(wrong)[0].tolist()
    return f"that of world {worlds[world]}, element {element}", values[(world, *element)]


def bounds_of_meshes(model: Any, ids: np.ndarray, now: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The values of geom_size, geom_aabb and geom_rbound, of which those of meshes fit these ``geom_dataid`` ``[B, ngeom]``.

    MuJoCo has them from the compiler, and misses contacts outside of them.
    """
    sizes, boxes, radii = (now[name].copy() for name in ("geom_size", "geom_aabb", "geom_rbound"))
    meshes = np.broadcast_to(model.geom_type == mujoco_names.Geom.MESH, ids.shape)
    for mesh in np.unique(ids[meshes]):
        start = model.mesh_vertadr[mesh]
        vertices = model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(np.float64)
        low, high = vertices.min(0), vertices.max(0)
        here = meshes & (ids == mesh)
        sizes[here] = np.maximum(-low, high)
        boxes[here] = [*(high + low) / 2, *(high - low) / 2]
        radii[here] = np.linalg.norm(np.maximum(-low, high))
    return {"geom_size": sizes, "geom_aabb": boxes, "geom_rbound": radii}


def _check_types(model: Any, field: str, values: np.ndarray) -> None:
    """Geom types may change to other primitives; meshes, height fields and signed distance fields cannot change."""
    if field == "geom_type":
        kinds = mujoco_names.Geom
        primitives = [kinds.PLANE, kinds.SPHERE, kinds.CAPSULE, kinds.ELLIPSOID, kinds.CYLINDER, kinds.BOX]
        fits = (values == model.geom_type) | (np.isin(values, primitives) & np.isin(model.geom_type, primitives))
    else:
        fits = (values >= 0) & (values <= (1 if field == "cam_projection" else 3))
    if not fits.all():
        raise ValueError(f"{field}: {np.unique(values[~fits]).tolist()} cannot be given here")
