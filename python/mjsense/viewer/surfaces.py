# SPDX-License-Identifier: Apache-2.0
"""What the geoms of a model look like: triangles with a colour or a texture."""

from __future__ import annotations

import hashlib
import io
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mjsense.core import mujoco_names
from mjsense.viewer import geometry
from mjsense.viewer.geometry import Triangles
from mjsense.viewer.glb import glb

_RGB, _RGBA = 1, 8  # mjtTextureRole
_TEXTURE_2D, _TEXTURE_CUBE = 0, 1  # mjtTexture
_MAX_SIDE = 512  # pixels of a texture; larger ones are reduced
_PLAIN = 2.0  # standard deviation below which a texture is shown by its mean colour


class Surface(NamedTuple):
    """What a browser draws for one geom."""

    shape: Triangles
    rgba: np.ndarray
    """Colour, 0 to 1; of a textured surface the factor that the texture is multiplied with, except for alpha."""
    glb: bytes | None
    """The textured mesh; None: a mesh of one colour."""
    texture: np.ndarray | None
    """uint8 [H, W, 3], if there is a texture."""


class SitesAsGeoms:
    """A model whose sites are read as geoms, for the functions of this module."""

    def __init__(self, model: Any) -> None:
        self._model = model
        self.geom_dataid = np.full(model.nsite, -1)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name.replace("geom_", "site_"))


def key_of(model: Any, geom: int) -> tuple[Any, ...]:
    """The values of the model that the surface of a geom depends on."""
    material = int(model.geom_matid[geom])
    of_material = (
        ()
        if material < 0
        else tuple(
            getattr(model, f"mat_{name}")[material].tobytes()
            for name in ("rgba", "texid", "texrepeat", "texuniform", "shininess", "specular")
        )
    )
    return (
        int(model.geom_type[geom]),
        int(model.geom_dataid[geom]),
        model.geom_size[geom].tobytes(),
        rgba_of(model, geom).tobytes(),
        *of_material,
    )


def rgba_of(model: Any, geom: int) -> np.ndarray:
    """The colour of a geom: its own one unless that is MuJoCo's default and the geom has a material."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    unset = np.array_equal(own, np.array([0.5, 0.5, 0.5, 1], own.dtype))
    return np.array(model.mat_rgba[material] if material >= 0 and unset else own, np.float64)


def of_geom(model: Any, geom: int, reach: float) -> Surface | None:
    """None if nothing is to be seen. ``reach``: half side of planes without an end. [m]"""
    rgba = rgba_of(model, geom)
    texture = _texture_of(model, int(model.geom_matid[geom]))
    shape = geometry.of_geom(model, geom, reach, mapped=texture >= 0) if rgba[3] > 0 else None
    if shape is None:
        return None
    if texture < 0:
        return Surface(shape, rgba, None, None)
    pixels, cube = _pixels(model, texture), int(model.tex_type[texture]) == _TEXTURE_CUBE
    shape = _cube_mapped(model, geom, shape) if cube else _mapped(model, geom, shape)
    if shape.uv is None or pixels[::4, ::4].reshape(-1, 3).std(0).max() < _PLAIN:
        mean = pixels[::4, ::4].reshape(-1, 3).mean(0) / 255
        return Surface(geometry.welded(shape), np.array([*(rgba[:3] * mean), rgba[3]]), None, None)
    material = int(model.geom_matid[geom])
    return Surface(shape, rgba, glb(shape, *_encoded(pixels), rgba, float(1 - 0.5 * model.mat_shininess[material])), pixels)


def _texture_of(model: Any, material: int) -> int:
    """Id of the colour texture of a material; -1: none."""
    if material < 0:
        return -1
    ids = model.mat_texid[material]
    found = next((int(ids[role]) for role in (_RGB, _RGBA) if ids[role] >= 0), -1)
    return found if found >= 0 and int(model.tex_type[found]) in (_TEXTURE_2D, _TEXTURE_CUBE) else -1


def _pixels(model: Any, texture: int) -> np.ndarray:
    """uint8 [H, W, 3]; the six faces of a cube are below each other."""
    height, width, channels = (int(getattr(model, f"tex_{name}")[texture]) for name in ("height", "width", "nchannel"))
    start = int(model.tex_adr[texture])
    pixels = model.tex_data[start : start + height * width * channels].reshape(height, width, channels)
    return np.repeat(pixels, 3, 2) if channels == 1 else pixels[..., :3]


def _encoded(pixels: np.ndarray) -> tuple[bytes, str]:
    """The image as JPEG, and its type."""
    return _encode(hashlib.sha256(pixels.tobytes()).digest(), _Hidden(pixels)), "image/jpeg"


class _Hidden:
    """An argument that a cache does not compare, because the digest identifies it."""

    def __init__(self, pixels: np.ndarray) -> None:
        self.pixels = pixels

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return True


@lru_cache(256)
def _encode(digest: bytes, hidden: _Hidden) -> bytes:
    from PIL import Image  # pyright: ignore[reportMissingImports]  # a dependency of viser

    height, width = hidden.pixels.shape[:2]
    faces = 6 if height == 6 * width else 1
    factor = -(-max(height // faces, width) // _MAX_SIDE)
    image = Image.fromarray(np.ascontiguousarray(hidden.pixels)).reduce(factor)
    file = io.BytesIO()
    image.save(file, "JPEG", quality=85)
    return file.getvalue()


def _mapped(model: Any, geom: int, shape: Triangles) -> Triangles:
    """A shape under a 2D texture. Meshes without coordinates and height fields are textured from above."""
    material, kind = int(model.geom_matid[geom]), int(model.geom_type[geom])
    repeat = np.array(model.mat_texrepeat[material], np.float64)
    size = _extent(model, geom)
    uv = shape.uv
    if uv is None:
        uv = shape.vertices[:, :2] * (0.5 / np.maximum(size[:2], 1e-9) * (1, -1))
    from_above = shape.uv is None or kind == mujoco_names.Geom.HFIELD
    if not from_above:
        repeat[repeat <= 0] = 1
    if model.mat_texuniform[material]:
        repeat *= np.where(size[:2] > 0, size[:2], 1)
    uv = uv * repeat
    if from_above or (kind == mujoco_names.Geom.PLANE and (model.geom_size[geom, :2] <= 0).any()):
        uv = uv - 0.5
    return shape._replace(uv=uv.astype(np.float32))


def _extent(model: Any, geom: int) -> np.ndarray:
    """Half sides of the geom as it is drawn, m; 0: without an end."""
    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom], np.float64)
    types = mujoco_names.Geom
    if kind == types.SPHERE:
        return np.repeat(size[0], 3)
    if kind in (types.CAPSULE, types.CYLINDER):
        return size[[0, 0, 1]]
    return size


def _cube_mapped(model: Any, geom: int, shape: Triangles) -> Triangles:
    """A shape under a cube texture: each triangle is on one face of the cube, that in whose direction its centre is."""
    extent, uniform = _extent(model, geom), bool(model.mat_texuniform[int(model.geom_matid[geom])])
    types = mujoco_names.Geom
    in_metres = int(model.geom_type[geom]) in (types.MESH, types.SDF, types.HFIELD, types.PLANE)
    scaled = extent if in_metres else 1 / np.where(extent > 0, extent, 1)
    stretch = scaled if uniform == in_metres else np.ones(3)
    corners = shape.vertices[shape.faces] * stretch  # [F, 3, 3]
    centre = corners.mean(1)
    axis = np.abs(centre).argmax(1)
    rows = np.arange(len(axis))
    negative = centre[rows, axis] < 0
    x, y, z = (corners[..., k] for k in range(3))
    sign = np.where(negative, -1.0, 1.0)[:, None]
    s = np.choose(axis[:, None], [-sign * z, x, sign * x])
    t = np.choose(axis[:, None], [-y, sign * z, -y])
    depth = np.maximum(np.abs(corners[rows, :, axis]), 1e-9)
    inside = 1 - 1 / 64  # keeps the filter within the face
    u, v = 0.5 + 0.5 * inside * np.clip(s / depth, -1, 1), 0.5 + 0.5 * inside * np.clip(t / depth, -1, 1)
    face = 2 * axis + negative
    uv = np.stack([u, (face[:, None] + v) / 6], -1).reshape(-1, 2).astype(np.float32)
    count = len(shape.faces)
    return Triangles(
        shape.vertices[shape.faces].reshape(-1, 3),
        np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
        shape.normals[shape.faces].reshape(-1, 3),
        uv,
    )
