# SPDX-License-Identifier: Apache-2.0
"""The scene of an episode as viewers draw it: the visible geoms of each body, and the poses of the bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.rotations import rotation_of
from mjsense.dataset import playback

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset import Episode
else:
    mujoco = libmujoco.shared

_SEEN_GROUPS = 3  # MuJoCo's viewers show the geom groups 0, 1 and 2
_PLANE = 5.0  # half the size of a plane without a size [m]
_NO_COLOUR = (0.5, 0.5, 0.5, 1)  # a geom of this colour has that of its material


@dataclass(frozen=True)
class Shape:
    """A geom in the frame of its body."""

    name: str
    number: int
    """Number in its body."""
    kind: str
    """``box``, ``ellipsoid``, ``cylinder`` and ``capsule`` along z, or ``mesh``."""
    size: np.ndarray
    """Half sizes; of a cylinder or capsule radius, radius and half length. [m]"""
    position: np.ndarray
    quat: np.ndarray
    """wxyz."""
    rgba: np.ndarray
    triangles: np.ndarray | None = None
    """Corners of a mesh in the geom's frame: [n, 3, 3]."""

    @property
    def rotation(self) -> np.ndarray:
        """[3, 3]."""
        return rotation_of(self.quat)


@dataclass(frozen=True)
class Body:
    """A body with visible geoms, and its pose in the world at every observation."""

    name: str
    number: int
    """Number in the model."""
    shapes: tuple[Shape, ...]
    positions: np.ndarray
    """[T, 3]."""
    quats: np.ndarray
    """wxyz: [T, 4]."""

    @property
    def moves(self) -> bool:
        """Whether the pose changes during the episode."""
        return bool((self.positions != self.positions[0]).any() or (self.quats != self.quats[0]).any())


def bodies(episode: Episode) -> list[Body]:
    """Bodies with visible geoms, without objects that are absent in the episode. Empty if the recording has no data for replay,
    or another MuJoCo is installed."""
    if mujoco is None or "replay/state" not in episode.streams:
        return []
    model = episode.model()
    poses = [(data.xpos.copy(), data.xquat.copy()) for _, data in episode.replay(model=model)]
    positions, quats = np.stack([p for p, _ in poses]), np.stack([q for _, q in poses])
    absent = {int(model.body_rootid[model.jnt_bodyid[joint]]) for joint in playback.inputs_of(episode).held}
    present = [i for i in range(model.nbody) if i == 0 or int(model.body_rootid[i]) not in absent]
    return [
        Body(model.body(i).name, i, shapes, positions[:, i], quats[:, i]) for i in present if (shapes := tuple(_shapes(model, i)))
    ]


def _shapes(model: mujoco.MjModel, body: int) -> Iterator[Shape]:
    kinds = mujoco.mjtGeom
    for i in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        material, size, position = model.geom_matid[i], model.geom_size[i], model.geom_pos[i]
        rgba = (
            model.mat_rgba[material] if material >= 0 and np.array_equal(model.geom_rgba[i], _NO_COLOUR) else model.geom_rgba[i]
        )
        if model.geom_group[i] >= _SEEN_GROUPS or rgba[3] == 0:
            continue
        name, quat = model.geom(i).name or f"geom_{i}", model.geom_quat[i]
        kind, number = kinds(model.geom_type[i]), i - model.body_geomadr[body]
        if kind == kinds.mjGEOM_PLANE:
            half = np.array([size[0] or _PLANE, size[1] or _PLANE, 0.001])
            yield Shape(name, number, "box", half, position - [0, 0, half[2]], quat, rgba)
        elif kind == kinds.mjGEOM_BOX:
            yield Shape(name, number, "box", size, position, quat, rgba)
        elif kind in (kinds.mjGEOM_SPHERE, kinds.mjGEOM_ELLIPSOID):
            half = size if kind == kinds.mjGEOM_ELLIPSOID else np.full(3, size[0])
            yield Shape(name, number, "ellipsoid", half, position, quat, rgba)
        elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
            form = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
            yield Shape(name, number, form, np.array([size[0], size[0], size[1]]), position, quat, rgba)
        elif kind == kinds.mjGEOM_MESH:
            mesh = model.geom_dataid[i]
            vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
            faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
            yield Shape(name, number, "mesh", size, position, quat, rgba, vertices[faces])
