# SPDX-License-Identifier: Apache-2.0
"""The model of one episode as MJCF: the archived model with the episode's sizes, masses, colours and so on."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core import libmujoco
from mjsense.dataset import playback
from mjsense.dataset.archive import MODEL_FILE, read_archive
from mjsense.dataset.closed_model import closed_model
from mjsense.scene.randomizable import field_of

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.episode import Episode
else:
    mujoco = libmujoco.shared

# Element lists of mjSpec by the prefix of their fields in mjModel. Fields and attributes have the same names, except those in
# _RENAMED.
_ELEMENTS = {
    "body": "bodies",
    "geom": "geoms",
    "jnt": "joints",
    "site": "sites",
    "cam": "cameras",
    "light": "lights",
    "mat": "materials",
    "actuator": "actuators",
    "eq": "equalities",
    "tendon": "tendons",
}
_RENAMED = {"eq_data": "data", "eq_active0": "active", "actuator_ctrlrange": "ctrlrange"}
# The compiler computes these from the others.
_DERIVED = set(
    """
    body_invweight0 body_subtreemass bvh_aabb dof_M0 dof_invweight0 geom_aabb geom_rbound actuator_acc0 actuator_length0
    tendon_length0 tendon_invweight0 cam_pos0 cam_poscom0 cam_mat0 light_pos0 light_poscom0 light_dir0
    """.split()
)
_INERTIAL = ("body_mass", "body_inertia", "body_ipos", "body_iquat")
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH) if mujoco else -1


def _write_mesh_geom(geom: Any, model: mujoco.MjModel) -> None:
    """The mesh, and the pose relative to it: the compiler moves a mesh to its principal axes of inertia and adds that to the
    geom's pose."""
    mesh = int(model.geom_dataid[geom.id])
    geom.meshname = model.mesh(mesh).name
    inverse, quat, offset = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(quat, model.geom_quat[geom.id], inverse)
    mujoco.mju_rotVecQuat(offset, model.mesh_pos[mesh], quat)
    geom.pos, geom.quat = model.geom_pos[geom.id] - offset, quat


def model_xml(episode: Episode) -> tuple[str, dict[str, bytes]]:
    """MJCF of the episode's model and the files that it names. MuJoCo compiles it to the model of the episode, except for
    rounding.

    Raises:
        ValueError: The recording has no data for replay, or a changed field of the model cannot be written as MJCF.
    """
    model = playback.model_of(episode)
    archive = playback.archive_of(episode)
    assets = read_archive(archive)
    text = closed_model(assets.pop(MODEL_FILE), assets, f"{archive}: {MODEL_FILE}")
    spec = mujoco.MjSpec.from_string(text, assets=assets)
    archived = spec.compile()  # also gives the elements their ids
    changed = [field for field in playback.changed_fields(episode) if field not in _DERIVED]
    if {"geom_dataid", "geom_pos", "geom_quat"} & set(changed):
        for geom in spec.geoms:
            if model.geom_type[geom.id] == _MESH:
                _write_mesh_geom(geom, model)
    for field in changed:
        if field.startswith("opt."):
            setattr(spec.option, field.removeprefix("opt."), getattr(model.opt, field.removeprefix("opt.")))
            continue
        prefix, _, name = field.partition("_")
        new, old = getattr(model, field), getattr(archived, field)
        for element in getattr(spec, _ELEMENTS.get(prefix, ""), ()):
            i = element.id
            if np.array_equal(new[i], old[i]):
                continue
            if field == "mat_texid":
                for role, texture in enumerate(new[i]):
                    element.textures[role] = model.tex(texture).name if texture >= 0 else ""
            elif field in _INERTIAL:
                element.mass, element.inertia = model.body_mass[i], model.body_inertia[i]
                element.ipos, element.iquat = model.body_ipos[i], model.body_iquat[i]
                element.fullinertia, element.explicitinertial = np.full(6, np.nan), True
            elif prefix != "geom" or model.geom_type[i] != _MESH or name not in ("dataid", "pos", "quat", "size"):
                _set(element, _RENAMED.get(field, name), new[i])
    try:
        result = _exact_xml(spec)
        compiled = mujoco.MjModel.from_xml_string(result, assets)
    except ValueError as error:
        raise ValueError(
            f"{playback.where(episode)}: MJCF cannot express its {', '.join(changed)}: {' '.join(str(error).split())}"
        ) from error
    if wrong := [
        field for field in changed if not np.allclose(field_of(compiled, field), field_of(model, field), rtol=1e-5, atol=1e-8)
    ]:
        raise ValueError(f"{playback.where(episode)}: MJCF cannot express its {', '.join(wrong)}")
    return result, assets


def _exact_xml(spec: mujoco.MjSpec) -> str:
    """MJCF with all 17 digits of its numbers; MuJoCo writes 6."""
    library = ctypes.CDLL(None)  # mjsense has made the symbols of libmujoco global
    digits = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(17)
    try:
        return spec.to_xml()
    finally:
        library._mjPRIVATE__set_xml_precision(digits)


def _set(element: Any, name: str, value: Any) -> None:
    try:
        old = getattr(element, name)
        setattr(element, name, value if np.ndim(old) else np.asarray(value).item())
    except (AttributeError, TypeError, ValueError):
        pass  # the comparison with the compiled model reports the field
