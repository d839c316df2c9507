# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's enumerations, ids and names of elements, and specs. The package ``mujoco`` is not needed."""

from __future__ import annotations

import os
import sys
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import libmujoco
from mjsense.core.errors import UnknownNameError

if TYPE_CHECKING:
    import mujoco

STATE = tuple("time qpos qvel act ctrl qfrc_applied xfrc_applied eq_active mocap_pos mocap_quat qacc_warmstart userdata".split())
"""Fields of mjData that determine what sensors measure: the parts of ``sim.state``."""
MAXVAL = 1e10
"""mjMAXVAL: larger limits mean none."""


class Obj(IntEnum):
    """mjtObj, as far as it is used here."""

    BODY = 1
    JOINT = 3
    GEOM = 5
    SITE = 6
    CAMERA = 7
    LIGHT = 8
    MESH = 10
    HFIELD = 12
    TEXTURE = 13
    MATERIAL = 14
    PAIR = 15
    EXCLUDE = 16
    EQUALITY = 17
    TENDON = 18
    ACTUATOR = 19
    SENSOR = 20
    NUMERIC = 21
    TEXT = 22
    KEY = 24
    FRAME = 100


class Geom(IntEnum):
    """mjtGeom, as far as it is used here."""

    PLANE = 0
    HFIELD = 1
    SPHERE = 2
    CAPSULE = 3
    ELLIPSOID = 4
    CYLINDER = 5
    BOX = 6
    MESH = 7
    SDF = 8


class Joint(IntEnum):
    """mjtJoint."""

    FREE = 0
    BALL = 1
    SLIDE = 2
    HINGE = 3


def name2id(model: Any, kind: Obj, name: str) -> int:
    """mj_name2id."""
    return _core.name2id(model._address, kind, name)


def id2name(model: Any, kind: Obj, index: int) -> str:
    """mj_id2name; "" if the element has no name."""
    return _core.id2name(model._address, kind, index)


def known_id(model: Any, kind: Obj, name: str, context: str) -> int:
    """The id of a body, joint or camera. Raises UnknownNameError, with the nearest names, if there is none of that name."""
    found = name2id(model, kind, name)
    if found < 0:
        count = {Obj.BODY: model.nbody, Obj.JOINT: model.njnt, Obj.CAMERA: model.ncam}[kind]
        names = [id2name(model, kind, i) for i in range(count)]
        raise UnknownNameError(_core.unknown_name(context, kind.name.lower(), name, list(filter(None, names))))
    return found


def rows_of_joint(model: Any, joint: int) -> tuple[slice, slice]:
    """Elements of a joint in qpos and in qvel."""
    positions, dofs = {Joint.FREE: (7, 6), Joint.BALL: (4, 3)}.get(Joint(model.jnt_type[joint]), (1, 1))
    qpos, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    return slice(qpos, qpos + positions), slice(dof, dof + dofs)


def free_camera(model: Any) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and viewing direction of MuJoCo's free camera at its start."""
    azimuth, elevation = np.radians([model.vis.global_.azimuth, model.vis.global_.elevation])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    return model.stat.center - 1.5 * model.stat.extent * forward, forward


def bodies_below(model: Any, root: int) -> np.ndarray:
    """Whether each body is ``root`` or below it: bool ``[nbody]``."""
    below = np.arange(model.nbody) == root
    for body in range(root + 1, model.nbody):  # parents come first
        below[body] = below[model.body_parentid[body]]
    return below


WARNINGS = (
    "mjWARN_INERTIA",
    "mjWARN_CONTACTFULL",
    "mjWARN_CNSTRFULL",
    "mjWARN_BADQPOS",
    "mjWARN_BADQVEL",
    "mjWARN_BADQACC",
    "mjWARN_BADCTRL",
)
"""Names of mjtWarning."""


def is_spec(found: Any) -> bool:
    """Whether this is a ``mujoco.MjSpec`` of any series."""
    mujoco = sys.modules.get("mujoco")  # who has made one has imported it
    return mujoco is not None and hasattr(mujoco, "MjSpec") and isinstance(found, mujoco.MjSpec)


def source_of(spec: mujoco.MjSpec) -> tuple[str, Any]:
    """A spec as a source of an entity: itself, or as XML if it is of another series."""
    if libmujoco.shared is not None:
        return "spec", spec
    copy = spec.copy()
    compiler = getattr(copy, "compiler", copy)
    for elements, folder in (
        (copy.meshes, "meshdir"),
        (copy.skins, "meshdir"),
        (copy.hfields, "meshdir"),
        (copy.textures, "texturedir"),
    ):
        for element in elements:
            inside = os.path.join(getattr(compiler, folder, ""), element.file)
            path = os.path.join(copy.modelfiledir, inside)
            if element.file and not {element.file, inside} & {*copy.assets} and os.path.isfile(path):
                element.file = os.path.abspath(path)  # the XML has no folder that names can be relative to
    copy.compile()
    return "xml", copy.to_xml()
