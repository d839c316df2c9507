# SPDX-License-Identifier: Apache-2.0
"""Normals of the surfaces in a camera's image: computed from the geom and the depth that the renderer finds for each pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from mjsense.warp.sensor import Worlds, vec3_view
from mjsense.warp.surfaces import HFIELD, MESH, Surfaces, primitive_normal, ray_scene

wp.set_module_options({"enable_backward": False})

_OBJ_GEOM = wp.constant(5)  # mjOBJ_GEOM


@wp.struct
class MeshNormals:
    """Normals at the corners of all triangles of all meshes."""

    begin: wp.array(dtype=int)  # [nmesh] first triangle
    corner: wp.array2d(dtype=wp.vec3)  # [triangles, 3]


@wp.func
def _triangle_normal(surfaces: Surfaces, meshes: MeshNormals, kind: int, shape: int, o: wp.vec3, d: wp.vec3) -> wp.vec3:
    """Interpolated between the corners of a mesh's triangle; that of the triangle itself for a height field. The ray begins near
    the surface, where numbers are small."""
    tree = wp.uint64(0)
    if kind == HFIELD:
        tree = surfaces.height_fields[shape]
    else:
        tree = surfaces.meshes[shape]
    query = wp.mesh_query_ray(tree, o, d, 1.0e6)
    if not query.result:
        return wp.vec3()
    if kind == HFIELD:
        return wp.normalize(query.normal)
    corner = meshes.corner[meshes.begin[shape] + query.face]
    return wp.normalize(query.u * corner[0] + query.v * corner[1] + (1.0 - query.u - query.v) * corner[2])


@wp.kernel
def _find_normals(
    due: wp.array(dtype=bool),
    surfaces: Surfaces,
    meshes: MeshNormals,
    camera: int,
    camera_pos: wp.array2d(dtype=wp.vec3),
    camera_mat: wp.array2d(dtype=wp.mat33),
    direction: wp.array(dtype=wp.vec3),
    offset: wp.array(dtype=wp.vec3),
    found: wp.array2d(dtype=wp.vec2i),
    planar: wp.array2d(dtype=float),
    normals: wp.array2d(dtype=wp.vec3),
):
    w, i = wp.tid()
    if not due[w]:
        return
    normals[w, i] = wp.vec3()
    geom = found[w, i][0]
    if found[w, i][1] != _OBJ_GEOM:
        return
    mat = surfaces.mat[w, geom]
    to_geom = wp.transpose(mat) @ camera_mat[w, camera]
    o = wp.transpose(mat) @ (camera_pos[w, camera] - surfaces.pos[w, geom]) + to_geom @ offset[i]
    d = to_geom @ direction[i]
    distance = planar[w, i] / -direction[i][2]
    kind = surfaces.type[geom]
    n = wp.vec3(0.0, 0.0, 1.0)
    if kind == HFIELD or kind == MESH:
        n = _triangle_normal(
            surfaces, meshes, kind, surfaces.data_id[w % surfaces.data_id.shape[0], geom], o + 0.99 * distance * d, d
        )
    else:
        n = primitive_normal(kind, surfaces.size[w % surfaces.size.shape[0], geom], o + distance * d)
    normals[w, i] = wp.transpose(to_geom) @ n


class CameraNormals:
    """Fills the field ``normals`` of a camera, float32 ``[B, H, W, 3]`` in the camera's frame; 0 where nothing is seen."""

    def __init__(self, worlds: Worlds, camera: int, field: wp.array) -> None:
        self.worlds, self.camera = worlds, camera
        self.scene = ray_scene(worlds)
        model: Any = worlds.compiled.model
        self.meshes = MeshNormals()
        self.meshes.begin = worlds.array(np.append(model.mesh_faceadr, 0), int)
        self.meshes.corner = worlds.array(_corner_normals(model), wp.vec3)
        count = worlds.num_worlds
        self.normals = vec3_view(field.reshape((count, field.size // count // 3, 3)))

    def update(self, due: wp.array, context: Any) -> None:
        data = self.worlds.data
        inputs = [
            due,
            self.scene.surfaces,
            self.meshes,
            self.camera,
            data.cam_xpos,
            data.cam_xmat,
            context.ray,
            context.ray_offset,
        ]
        inputs += [context.seg_data, context.depth_data, self.normals]
        wp.launch(_find_normals, dim=self.normals.shape, inputs=inputs, device=self.worlds.device)


_CREASE = 0.8
"""Cosine of the angle between a corner's normal and its triangle from which on they are an edge, which stays sharp."""


def _corner_normals(model: Any) -> np.ndarray:
    """Unit normals at the corners of all triangles, ``[triangles, 3, 3]``, as in ``render/view/surface_assets.cc``."""
    corners = np.zeros((model.mesh_facenormal.shape[0] + 1, 3, 3))
    for mesh in range(model.nmesh):
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        points = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]]
        flat = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        flat = (flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-30))[:, None]
        smooth = model.mesh_normal[model.mesh_normaladr[mesh] + model.mesh_facenormal[faces]]
        sharp = ((smooth * flat).sum(-1, keepdims=True) < _CREASE) & (model.mesh_texcoordadr[mesh] < 0)
        corners[faces] = np.where(sharp, flat, smooth)
    return corners
