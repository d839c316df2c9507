# SPDX-License-Identifier: Apache-2.0
"""Triangles of the geoms of a model."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mjsense.core import mujoco_names

_AROUND = 40  # segments of a circle
_MAX_GRID = 400  # vertices of a height field along one side; larger fields are thinned out


class Triangles(NamedTuple):
    """Triangles with one normal and one pair of texture coordinates for each vertex."""

    vertices: np.ndarray
    """float32 [V, 3] m, geom frame."""
    faces: np.ndarray
    """uint32 [F, 3], counter-clockwise seen from outside."""
    normals: np.ndarray
    """float32 [V, 3]."""
    uv: np.ndarray | None
    """float32 [V, 2]; (0, 0) is the first texel of the texture. None: the shape has no texture coordinates."""


def of_geom(model: Any, geom: int, reach: float, mapped: bool = True) -> Triangles | None:
    """The triangles of a geom; None if it has none.

    Args:
        reach: Half side of planes without an end. [m]
        mapped: With texture coordinates. Without them, vertices that agree in position and normal are one.
    """
    shape = _of_geom(model, geom, reach, mapped)
    return shape if mapped or shape is None or shape.uv is None else welded(shape)


def _of_geom(model: Any, geom: int, reach: float, mapped: bool) -> Triangles | None:
    kind, size, data = int(model.geom_type[geom]), model.geom_size[geom], int(model.geom_dataid[geom])
    types = mujoco_names.Geom
    if kind == types.PLANE:
        return _plane(size, reach)
    if kind == types.HFIELD:
        return _height_field(model, data)
    if kind in (types.MESH, types.SDF):
        return _mesh(model, data, mapped) if data >= 0 else None
    if kind == types.BOX:
        unit = _unit_box()
        return unit._replace(vertices=unit.vertices * size.astype(np.float32))
    if kind in (types.SPHERE, types.ELLIPSOID):
        radii = np.repeat(size[:1], 3) if kind == types.SPHERE else size
        unit = unit_sphere()
        return unit._replace(vertices=(unit.vertices * radii).astype(np.float32), normals=_unit(unit.normals / radii))
    if kind == types.CAPSULE:
        return _capsule(float(size[0]), float(size[1]))
    if kind == types.CYLINDER:
        return _cylinder(float(size[0]), float(size[1]))
    return None


def welded(shape: Triangles) -> Triangles:
    """The same without texture coordinates; vertices that agree in position and normal become one."""
    rows = np.concatenate([shape.vertices, shape.normals], axis=1).round(6)
    _, first, where = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return Triangles(shape.vertices[first], where.reshape(-1)[shape.faces].astype(np.uint32), shape.normals[first], None)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)).astype(np.float32)


def _grid_faces(rows: int, columns: int) -> np.ndarray:
    """Two triangles for each cell of a grid of vertices in row-major order."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    right, below, across = corner + 1, corner + columns, corner + columns + 1
    return np.concatenate([np.stack([corner, right, across], 1), np.stack([corner, across, below], 1)]).astype(np.uint32)


def _revolved(radius: np.ndarray, z: np.ndarray, slope: np.ndarray, v: np.ndarray) -> Triangles:
    """A profile turned around the z axis, from top to bottom; ``slope``: normals (radial, axial) of the profile."""
    angle = np.linspace(0, 2 * np.pi, _AROUND + 1)
    around = np.stack([np.cos(angle), np.sin(angle)], 1)
    shape = (len(z), len(angle))
    vertices = np.empty((*shape, 3), np.float32)
    vertices[..., :2], vertices[..., 2] = radius[:, None, None] * around, z[:, None]
    normals = np.empty_like(vertices)
    normals[..., :2], normals[..., 2] = slope[:, :1, None] * around, slope[:, 1:]
    uv = np.stack(np.broadcast_arrays(np.linspace(0, 1, shape[1]), v[:, None]), -1).astype(np.float32)
    faces = _grid_faces(*shape)[:, [0, 2, 1]]
    return Triangles(vertices.reshape(-1, 3), faces, _unit(normals.reshape(-1, 3)), uv.reshape(-1, 2))


@lru_cache(1)
def unit_sphere() -> Triangles:
    """A sphere with radius 1 m."""
    polar = np.linspace(0, np.pi, _AROUND // 2 + 1)
    slope = np.stack([np.sin(polar), np.cos(polar)], 1)
    return _revolved(slope[:, 0], slope[:, 1], slope, polar / np.pi)


def _capsule(radius: float, half: float) -> Triangles:
    polar = np.linspace(0, np.pi / 2, _AROUND // 4 + 1)
    top = np.stack([np.sin(polar), np.cos(polar)], 1)
    slope = np.concatenate([top, top[::-1] * (1, -1)])
    middle = np.repeat([half, -half], len(polar))
    cap = 2 * polar / np.pi  # as MuJoCo textures the two half spheres
    return _revolved(radius * slope[:, 0], middle + radius * slope[:, 1], slope, np.concatenate([cap, cap[::-1]]))


def _cylinder(radius: float, half: float) -> Triangles:
    side = _revolved(np.full(2, radius), np.array([half, -half]), np.array([[1.0, 0], [1, 0]]), np.array([0.0, 1]))
    parts = [side]
    for sign in (1, -1):
        cap = _revolved(np.array([1e-9, radius]), np.full(2, sign * half), np.array([[0.0, sign]] * 2), np.zeros(2))
        faces = cap.faces if sign > 0 else cap.faces[:, [0, 2, 1]]
        parts.append(cap._replace(faces=faces, uv=0.5 + 0.5 * cap.vertices[:, :2] / radius))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Triangles(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts)]).astype(np.uint32),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uv for part in parts if part.uv is not None]),
    )


@lru_cache(1)
def unit_cylinder() -> Triangles:
    """A cylinder with radius 1 m and height 2 m."""
    return _cylinder(1.0, 1.0)


@lru_cache(1)
def _unit_box() -> Triangles:
    vertices, normals, uv, faces = [], [], [], []
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    for axis in range(3):
        a, b = ((1, 2), (0, 2), (0, 1))[axis]
        for sign in (1, -1):
            points = np.zeros((4, 3), np.float32)
            points[:, axis], points[:, [a, b]] = sign, corners
            order = [0, 1, 2, 3] if (sign > 0) != (axis == 1) else [3, 2, 1, 0]
            faces += [[len(vertices) * 4 + order[k] for k in face] for face in ((0, 1, 2), (0, 2, 3))]
            vertices.append(points)
            normals.append(np.eye(3)[axis] * sign * np.ones((4, 1)))
            uv.append(0.5 + 0.5 * corners * (1, -1))
    return Triangles(
        np.concatenate(vertices),
        np.array(faces, np.uint32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(uv).astype(np.float32),
    )


def _plane(size: np.ndarray, reach: float) -> Triangles:
    half = np.where(size[:2] > 0, size[:2], reach)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    scale = np.where(size[:2] > 0, 0.5 / np.maximum(size[:2], 1e-9), 0.5)
    uv = corners * scale * (1, -1) + np.where(size[:2] > 0, 0.5, 0)
    vertices = np.concatenate([corners, np.zeros((4, 1))], 1).astype(np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (4, 1))
    return Triangles(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals, uv.astype(np.float32))


def _height_field(model: Any, field: int) -> Triangles:
    rows, columns, start = int(model.hfield_nrow[field]), int(model.hfield_ncol[field]), int(model.hfield_adr[field])
    rx, ry, top, base = model.hfield_size[field]
    heights = model.hfield_data[start : start + rows * columns].reshape(rows, columns) * top
    x, y = np.linspace(-rx, rx, columns), np.linspace(-ry, ry, rows)
    i, j = (np.unique(np.linspace(0, count - 1, min(count, _MAX_GRID)).round().astype(int)) for count in (rows, columns))
    heights, x, y = heights[np.ix_(i, j)], x[j], y[i]
    # The outermost vertices are repeated at the bottom: a wall around the field.
    pad = lambda values, bottom: np.pad(values, 1, mode="edge") if bottom is None else np.pad(values, 1, constant_values=bottom)  # noqa: E731
    heights, x, y = pad(heights, -base), pad(x, None), pad(y, None)
    vertices = np.stack([*np.meshgrid(x, y), heights], -1)
    dx, dy = np.gradient(heights, axis=1), np.gradient(heights, axis=0)
    spacing = 2 * rx / max(columns - 1, 1), 2 * ry / max(rows - 1, 1)
    normals = np.stack([-dx / spacing[0], -dy / spacing[1], np.ones_like(heights)], -1).reshape(-1, 3)
    uv = np.stack([vertices[..., 0] * (0.5 / rx), vertices[..., 1] * (-0.5 / ry)], -1)  # from -0.5 to 0.5
    return Triangles(
        vertices.reshape(-1, 3).astype(np.float32),
        _grid_faces(*heights.shape),
        _unit(normals),
        uv.reshape(-1, 2).astype(np.float32),
    )


def _mesh(model: Any, mesh: int, mapped: bool) -> Triangles | None:
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    if not count:
        return None
    faces = slice(first, first + count)
    corners = [model.mesh_face[faces], model.mesh_facenormal[faces]]
    textured = mapped and int(model.mesh_texcoordadr[mesh]) >= 0
    if textured:
        corners.append(model.mesh_facetexcoord[faces])
    # Each combination of position, normal and texture coordinates is a vertex.
    key = np.zeros(3 * count, np.int64)
    for ids in corners:
        key = key * (int(ids.max()) + 1) + ids.reshape(-1)
    _, first, where = np.unique(key, return_index=True, return_inverse=True)
    ids = [c.reshape(-1)[first] for c in corners]
    vertices = model.mesh_vert[int(model.mesh_vertadr[mesh]) + ids[0]]
    normals = model.mesh_normal[int(model.mesh_normaladr[mesh]) + ids[1]]
    uv = model.mesh_texcoord[int(model.mesh_texcoordadr[mesh]) + ids[2]].astype(np.float32) if textured else None
    return Triangles(vertices.astype(np.float32), where.reshape(-1, 3).astype(np.uint32), normals.astype(np.float32), uv)
