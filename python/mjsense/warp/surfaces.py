# SPDX-License-Identifier: Apache-2.0
"""What rays hit: the geoms of all worlds, with a tree of triangles for each mesh and height field, which the worlds share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco_warp as mjw
import numpy as np
import warp as wp

from mjsense.warp.sensor import Worlds
from mjsense.warp.shapes import (
    NO_HIT,
    hit_box,
    hit_capsule,
    hit_cylinder,
    hit_ellipsoid,
    hit_plane,
    hit_sphere,
    normal_box,
    normal_capsule,
    normal_cylinder,
    normal_ellipsoid,
    normal_sphere,
)

wp.set_module_options({"enable_backward": False})

PLANE = wp.constant(int(mjw.GeomType.PLANE))
HFIELD = wp.constant(int(mjw.GeomType.HFIELD))
SPHERE = wp.constant(int(mjw.GeomType.SPHERE))
CAPSULE = wp.constant(int(mjw.GeomType.CAPSULE))
ELLIPSOID = wp.constant(int(mjw.GeomType.ELLIPSOID))
CYLINDER = wp.constant(int(mjw.GeomType.CYLINDER))
BOX = wp.constant(int(mjw.GeomType.BOX))
MESH = wp.constant(int(mjw.GeomType.MESH))


@wp.struct
class Surfaces:
    """Arrays of mujoco_warp, whose leading dimension is 1 or B, and trees of triangles."""

    type: wp.array(dtype=int)
    data_id: wp.array2d(dtype=int)
    material: wp.array2d(dtype=int)
    size: wp.array2d(dtype=wp.vec3)
    radius: wp.array2d(dtype=float)  # of the bounding sphere; 0: endless
    rgba: wp.array2d(dtype=wp.vec4)
    material_rgba: wp.array2d(dtype=wp.vec4)
    body: wp.array(dtype=int)
    pos: wp.array2d(dtype=wp.vec3)
    mat: wp.array2d(dtype=wp.mat33)
    meshes: wp.array(dtype=wp.uint64)
    height_fields: wp.array(dtype=wp.uint64)
    use_tree: bool
    tree: wp.uint64  # boxes of the fixed geoms
    tree_geoms: wp.array(dtype=int)


@wp.struct
class Filter:
    """The geoms that the rays of each frame can hit: first those that move, then the fixed ones."""

    seen: wp.array2d(dtype=bool)  # [F, ngeom]
    geoms: wp.array(dtype=int)  # of all frames
    begin: wp.array(dtype=int)  # [F + 1]
    fixed: wp.array(dtype=int)  # [F]


@wp.struct
class Hit:
    t: float  # m; NO_HIT: nothing
    geom: int
    normal: wp.vec3  # outward, or by the winding of triangles; world


@wp.func
def colour(surfaces: Surfaces, w: int, geom: int) -> wp.vec4:
    material = surfaces.material[w % surfaces.material.shape[0], geom]
    if material >= 0:
        return surfaces.material_rgba[w % surfaces.material_rgba.shape[0], material]
    return surfaces.rgba[w % surfaces.rgba.shape[0], geom]


@wp.func
def _hit_triangles(tree: wp.uint64, o: wp.vec3, d: wp.vec3, start: float, limit: float) -> wp.vec4:
    """Distance and normal; the query starts near the mesh, where numbers are small."""
    query = wp.mesh_query_ray(tree, o + start * d, d, limit - start)
    if not query.result:
        return wp.vec4(NO_HIT, 0.0, 0.0, 0.0)
    return wp.vec4(start + query.t, query.normal[0], query.normal[1], query.normal[2])


@wp.func
def primitive_normal(kind: int, size: wp.vec3, p: wp.vec3) -> wp.vec3:
    """Outward, at a point of the surface; that of a plane for meshes and height fields."""
    if kind == SPHERE:
        return normal_sphere(p)
    if kind == CAPSULE:
        return normal_capsule(size, p)
    if kind == ELLIPSOID:
        return normal_ellipsoid(size, p)
    if kind == CYLINDER:
        return normal_cylinder(size, p)
    if kind == BOX:
        return normal_box(size, p)
    return wp.vec3(0.0, 0.0, 1.0)


@wp.func
def _nearer(surfaces: Surfaces, hit: Hit, w: int, geom: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> Hit:
    """The nearer one of a hit and that of a geom, within reach. Distances within rounding are a tie: the lower geom id wins."""
    pos = surfaces.pos[w, geom]
    to_centre = pos - origin
    limit = wp.min(reach, hit.t + 1.0e-6 * (1.0 + wp.length(to_centre) + wp.length(origin)))
    # Distance along the ray to the bounding sphere, with a margin for rounding.
    middle = wp.dot(to_centre, direction)
    aside = to_centre - middle * direction
    radius = surfaces.radius[w % surfaces.radius.shape[0], geom]
    start = float(0.0)
    if radius > 0.0:
        radius += 1.0e-4 + 1.0e-5 * (radius + wp.length(to_centre))
        if wp.dot(aside, aside) > radius * radius or middle + radius < 0.0 or middle - radius > limit:
            return hit
        start = wp.max(0.0, middle - radius)
    if colour(surfaces, w, geom)[3] == 0.0:
        return hit
    mat = surfaces.mat[w, geom]
    o = wp.transpose(mat) @ (origin - pos)
    d = wp.transpose(mat) @ direction
    size = surfaces.size[w % surfaces.size.shape[0], geom]
    kind = surfaces.type[geom]
    t = float(NO_HIT)
    found = wp.vec4()
    if kind == PLANE:
        t = hit_plane(size, o, d)
    elif kind == SPHERE:
        t = hit_sphere(size, o, d)
    elif kind == CAPSULE:
        t = hit_capsule(size, o, d)
    elif kind == ELLIPSOID:
        t = hit_ellipsoid(size, o, d)
    elif kind == CYLINDER:
        t = hit_cylinder(size, o, d)
    elif kind == BOX:
        t = hit_box(size, o, d)
    else:
        shape = surfaces.data_id[w % surfaces.data_id.shape[0], geom]
        tree = wp.uint64(0)
        if kind == HFIELD:
            tree = surfaces.height_fields[shape]
        else:
            tree = surfaces.meshes[shape]
        if tree != wp.uint64(0):
            found = _hit_triangles(tree, o, d, start, limit)
            t = found[0]
    if t > reach or t >= NO_HIT:
        return hit
    # The origin is float32, so the error of t grows with its coordinates.
    tie = 5.0e-7 + 4.0e-7 * (wp.abs(t) + wp.length(origin))
    is_nearer = t < hit.t - tie or (t <= hit.t + tie and geom < hit.geom)
    if not is_nearer:
        return hit
    p = o + t * d
    n = primitive_normal(kind, size, p)
    if kind == HFIELD or kind == MESH:
        n = wp.normalize(wp.vec3(found[1], found[2], found[3]))
    best = Hit()
    best.t = t
    best.geom = geom
    best.normal = mat @ n
    return best


@wp.func
def nearest_hit(surfaces: Surfaces, filter: Filter, f: int, w: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> Hit:
    """The nearest hit, within reach, of a ray of frame ``f``."""
    hit = Hit()
    hit.t = NO_HIT
    hit.geom = -1
    end = filter.begin[f + 1]
    if surfaces.use_tree:
        end = filter.fixed[f]
    for c in range(filter.begin[f], end):
        hit = _nearer(surfaces, hit, w, filter.geoms[c], origin, direction, reach)
    if surfaces.use_tree:
        query = wp.bvh_query_ray(surfaces.tree, origin, direction)
        item = int(0)
        while wp.bvh_query_next(query, item, wp.min(reach, hit.t + 1.0e-6 * (1.0 + hit.t + wp.length(origin)))):
            geom = surfaces.tree_geoms[item]
            if filter.seen[f, geom]:
                hit = _nearer(surfaces, hit, w, geom, origin, direction, reach)
    return hit


def _tree(points: np.ndarray, faces: np.ndarray, device: Any) -> wp.Mesh:
    return wp.Mesh(
        points=wp.array(np.ascontiguousarray(points, np.float32), dtype=wp.vec3, device=device),
        indices=wp.array(np.ascontiguousarray(faces, np.int32).reshape(-1), dtype=int, device=device),
        bvh_constructor="sah",  # built once, on the host; queries are faster than with the default of CUDA devices
    )


def height_field_triangles(size: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a height field: the surface, the side walls down to its zero, and the base box.

    Args:
        size: Half extents in x and y, height of the value 1, and depth of the base, m.
        heights: The values, ``[rows, columns]``, 0 to 1.
    """
    rows, columns = heights.shape
    x, y = np.linspace(-size[0], size[0], columns), np.linspace(-size[1], size[1], rows)
    grid = np.stack([*np.meshgrid(x, y), heights * size[2]], axis=-1).reshape(-1, 3)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    points = [grid]
    count = len(grid)
    for border in (at[0], at[:, -1], at[-1, ::-1], at[::-1, 0]):  # counter-clockwise from above: the outside is on the right
        low = grid[border] * (1.0, 1.0, 0.0)
        under = count + np.arange(len(border))
        faces.append(np.stack([border[:-1], under[:-1], under[1:]], axis=-1))
        faces.append(np.stack([border[:-1], under[1:], border[1:]], axis=-1))
        points.append(low)
        count += len(low)
    corners = np.array([(sx * size[0], sy * size[1], z) for z in (-size[3], 0.0) for sy in (-1, 1) for sx in (-1, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces += [count + np.array([q[:3], (q[0], q[2], q[3])]) for q in quads]
    points.append(corners)
    return np.concatenate(points), np.concatenate(faces)


_MIN_FIXED = 24
"""Number of fixed geoms from which on a tree is used."""
_FIXED_POSES = ("body_pos", "body_quat", "geom_pos", "geom_quat", "geom_size", "geom_dataid")
"""Fields of the model that move or resize fixed geoms. The tree is used while they are the same in all worlds."""


class RayScene:
    """The surfaces of the worlds. One object serves all sensors of a simulation."""

    def __init__(self, worlds: Worlds) -> None:
        model, device = worlds.compiled.model, worlds.device
        self.trees = []  # keeps them alive
        meshes, fields = np.zeros(max(model.nmesh, 1), np.uint64), np.zeros(max(model.nhfield, 1), np.uint64)
        for i in range(model.nmesh):
            vertex, face = model.mesh_vertadr[i], model.mesh_faceadr[i]
            faces = model.mesh_face[face : face + model.mesh_facenum[i]]
            if len(faces):
                meshes[i] = self._add(model.mesh_vert[vertex : vertex + model.mesh_vertnum[i]], faces, device)
        for i in range(model.nhfield):
            rows, columns, begin = model.hfield_nrow[i], model.hfield_ncol[i], model.hfield_adr[i]
            heights = model.hfield_data[begin : begin + rows * columns].reshape(rows, columns)
            fields[i] = self._add(*height_field_triangles(model.hfield_size[i], heights), device)
        self.worlds = worlds
        self.meshes, self.height_fields = worlds.array(meshes, wp.uint64), worlds.array(fields, wp.uint64)
        # Geoms of bodies without joints, except endless planes and mocap bodies.
        body = model.geom_bodyid
        self.fixed = (model.body_weldid[body] == 0) & (model.body_mocapid[model.body_rootid[body]] < 0) & (model.geom_rbound > 0)
        ids = np.flatnonzero(self.fixed)
        self.tree_geoms = worlds.array(ids, int)
        self.tree = self._tree_of_fixed(ids, model) if len(ids) >= _MIN_FIXED and worlds.num_worlds > 1 else None

    def _add(self, points: np.ndarray, faces: np.ndarray, device: Any) -> int:
        self.trees.append(_tree(points, faces, device))
        return self.trees[-1].id

    def _tree_of_fixed(self, ids: np.ndarray, model: Any) -> wp.Bvh:
        data = self.worlds.compiled.data
        pos, mat = data.geom_xpos[0][ids], data.geom_xmat[0][ids].reshape(-1, 3, 3)
        centre = pos + np.einsum("nij,nj->ni", mat, model.geom_aabb[ids].reshape(-1, 6)[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(mat), model.geom_aabb[ids].reshape(-1, 6)[:, 3:])
        half += 1e-5 + 1e-6 * (np.abs(centre) + half)
        return wp.Bvh(self.worlds.array(centre - half, wp.vec3), self.worlds.array(centre + half, wp.vec3), constructor="sah")

    def filter(self, groups: Any, excluded: Sequence[int]) -> Filter:
        """Geoms of these groups, except those of the body that is excluded for each frame; -1: none."""
        model, worlds = self.worlds.compiled.model, self.worlds
        visible = np.isin(np.clip(model.geom_group, 0, 5), list(groups))
        seen = np.array([visible & (model.geom_bodyid != body) for body in excluded])
        lists = [np.flatnonzero(row & ~self.fixed) for row in seen], [np.flatnonzero(row & self.fixed) for row in seen]
        moving = [len(ids) for ids in lists[0]]
        begin = np.cumsum([0, *(len(a) + len(b) for a, b in zip(*lists, strict=True))])
        f = Filter()
        f.seen = worlds.array(seen, bool)
        f.geoms = worlds.array(np.concatenate([*(np.concatenate(pair) for pair in zip(*lists, strict=True)), [0]]), int)
        f.begin, f.fixed = worlds.array(begin, int), worlds.array(begin[:-1] + moving, int)
        return f

    @property
    def surfaces(self) -> Surfaces:
        """The current arrays; randomize() replaces those of the model."""
        model, data, s = self.worlds.model, self.worlds.data, Surfaces()
        s.type, s.data_id, s.material, s.size = model.geom_type, model.geom_dataid, model.geom_matid, model.geom_size
        s.radius, s.rgba, s.material_rgba, s.body = model.geom_rbound, model.geom_rgba, model.mat_rgba, model.geom_bodyid
        s.pos, s.mat = data.geom_xpos, data.geom_xmat
        s.meshes, s.height_fields = self.meshes, self.height_fields
        s.tree_geoms = self.tree_geoms
        if self.tree is not None and all(getattr(model, name).shape[0] == 1 for name in _FIXED_POSES):
            s.use_tree, s.tree = True, self.tree.id
        return s


def ray_scene(worlds: Worlds) -> RayScene:
    """The ray scene of these worlds."""
    if "ray scene" not in worlds.shared:
        worlds.shared["ray scene"] = RayScene(worlds)
    return worlds.shared["ray scene"]
