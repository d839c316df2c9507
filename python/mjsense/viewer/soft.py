# SPDX-License-Identifier: Apache-2.0
"""What changes its shape in motion: flexes, skins and tendons."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np

from mjsense.core.rotations import inverse, product, rotation_of
from mjsense.sensors.drawing import DebugShapes
from mjsense.viewer.layer import ShapeLayer

Read = Callable[[str], np.ndarray]
"""Reads a field of a world's MjData by its name."""

_MIN_CHANGE = 1e-6  # m; smaller motions of vertices are not sent
_PULLEY = -2  # in MjData.wrap_obj


def fields_of(model: Any) -> list[str]:
    """The fields of MjData that a picture of a model depends on."""
    flexes, tendons = (
        ["flexvert_xpos"] * bool(model.nflex),
        ["ten_wrapadr", "ten_wrapnum", "wrap_obj", "wrap_xpos"] * bool(model.ntendon),
    )
    return ["xpos", "xquat", *flexes, *tendons]


class _Surface(NamedTuple):
    """A surface whose vertices move."""

    name: str
    faces: np.ndarray
    """uint32 [F, 3]."""
    rgba: np.ndarray
    vertices: Callable[[Read], np.ndarray]
    """Present positions: float32 [V, 3] m, world frame."""


class SoftParts:
    """Draws flexes, skins and tendons into a viser server."""

    def __init__(self, server: Any) -> None:
        self._server, self._tendons = server, ShapeLayer(server, "/tendons")
        self._drawn: list[tuple[_Surface, Any, np.ndarray]] = []

    def set_model(self, model: Any, groups: Collection[int]) -> None:
        """Draws the parts of a model in these groups at the next ``update``."""
        for _, handle, _ in self._drawn:
            handle.remove()
        self._drawn = []
        self._model, self._groups = model, groups
        self._waiting = [*_flexes(model, groups), *_skins(model, groups)]

    def update(self, read: Read) -> None:
        """Moves everything. Parts that stay are not sent again."""
        for surface in self._waiting:
            vertices = surface.vertices(read)
            rgb = tuple((np.clip(surface.rgba[:3], 0, 1) * 255).round().astype(int).tolist())
            opacity = float(surface.rgba[3]) if surface.rgba[3] < 1 else None
            handle = self._server.scene.add_mesh_simple(
                surface.name, vertices, surface.faces, color=rgb, opacity=opacity, side="double"
            )
            self._drawn.append((surface, handle, vertices))
        self._waiting = []
        for i, (surface, handle, sent) in enumerate(self._drawn):
            vertices = surface.vertices(read)
            if np.abs(vertices - sent).max(initial=0) >= _MIN_CHANGE:
                handle.vertices = vertices
                self._drawn[i] = surface, handle, vertices
        if self._model.ntendon:
            self._tendons.show(_tendons(self._model, self._groups, read))


def _flexes(model: Any, groups: Collection[int]) -> list[_Surface]:
    found = []
    for flex in range(model.nflex):
        if int(model.flex_group[flex]) not in groups:
            continue
        first, count = int(model.flex_vertadr[flex]), int(model.flex_vertnum[flex])
        dim = int(model.flex_dim[flex])
        if dim == 3:  # the triangles of the boundary
            start, number = int(model.flex_shelldataadr[flex]), int(model.flex_shellnum[flex])
            faces = model.flex_shell[start : start + 3 * number]
        else:
            start, number = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
            faces = model.flex_elem[start : start + (dim + 1) * number].reshape(number, dim + 1)
            faces = faces if dim == 2 else faces[:, [0, 1, 1]]
        found.append(
            _Surface(
                f"/flexes/{flex}",
                np.array(faces, np.uint32).reshape(-1, 3),
                np.array(model.flex_rgba[flex]),
                lambda read, part=slice(first, first + count): read("flexvert_xpos")[part].astype(np.float32),
            )
        )
    return found


def _skins(model: Any, groups: Collection[int]) -> list[_Surface]:
    found = []
    for skin in range(model.nskin):
        if int(model.skin_group[skin]) not in groups:
            continue
        start, count = int(model.skin_faceadr[skin]), int(model.skin_facenum[skin])
        faces = np.array(model.skin_face[start : start + count], np.uint32).reshape(-1, 3)
        rgba = model.mat_rgba[model.skin_matid[skin]] if model.skin_matid[skin] >= 0 else model.skin_rgba[skin]
        found.append(_Surface(f"/skins/{skin}", faces, np.array(rgba), lambda read, skin=skin: _skin_vertices(model, skin, read)))
    return found


def _skin_vertices(model: Any, skin: int, read: Read) -> np.ndarray:
    """Vertices moved with their bones, by weight, as mjv_updateActiveSkin does: float32 [V, 3]."""
    first, count = int(model.skin_vertadr[skin]), int(model.skin_vertnum[skin])
    rest, moved = model.skin_vert[first : first + count].reshape(-1, 3).astype(np.float64), np.zeros((count, 3))
    xpos, xquat = read("xpos"), read("xquat")
    for bone in range(int(model.skin_boneadr[skin]), int(model.skin_boneadr[skin] + model.skin_bonenum[skin])):
        body, start, number = (int(getattr(model, f"skin_bone{name}")[bone]) for name in ("bodyid", "vertadr", "vertnum"))
        ids, weights = model.skin_bonevertid[start : start + number], model.skin_bonevertweight[start : start + number]
        turn = rotation_of(product(xquat[body], inverse(model.skin_bonebindquat[bone].astype(np.float64))))
        moved[ids] += weights[:, None] * ((rest[ids] - model.skin_bonebindpos[bone]) @ turn.T + xpos[body])
    return moved.astype(np.float32)


def _tendons(model: Any, groups: Collection[int], read: Read) -> DebugShapes:
    """The paths of spatial tendons as cylinders. Parts that lie on a wrapping geom are half as thick, as in MuJoCo."""
    shapes = DebugShapes(0, float(model.stat.meansize))
    starts, numbers, on = read("ten_wrapadr"), read("ten_wrapnum"), read("wrap_obj").reshape(-1)
    points = read("wrap_xpos").reshape(-1, 3)
    for tendon in range(model.ntendon):
        if int(model.tendon_group[tendon]) not in groups:
            continue
        material = int(model.tendon_matid[tendon])
        rgba = model.mat_rgba[material] if material >= 0 else model.tendon_rgba[tendon]
        for k in range(int(starts[tendon]), int(starts[tendon] + numbers[tendon]) - 1):
            if _PULLEY not in (on[k], on[k + 1]):
                width = float(model.tendon_width[tendon]) * (0.5 if on[k] >= 0 and on[k + 1] >= 0 else 1)
                shapes.add_cylinder(points[k], points[k + 1], width, tuple(rgba))
    return shapes
