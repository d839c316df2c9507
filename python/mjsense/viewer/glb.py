# SPDX-License-Identifier: Apache-2.0
"""Textured triangles as binary glTF 2.0.

trimesh, on which viser depends, writes such files too, but not the same: it rounds the linear colour factors down to 8 bits,
which makes dark colours up to 4 % darker, and encodes the JPEG of the texture once more.
"""

from __future__ import annotations

import json
import struct

import numpy as np

from mjsense.core.srgb import decoded
from mjsense.viewer.geometry import Triangles

_FLOAT, _UINT = 5126, 5125
_VERTICES, _FACES = 34962, 34963  # targets of buffer views


def linear(colour: np.ndarray) -> list[float]:
    """sRGB colours 0 to 1 as glTF's linear factors."""
    return decoded(np.asarray(colour, np.float64)).tolist()


def glb(shape: Triangles, image: bytes, mime: str, rgba: np.ndarray, roughness: float) -> bytes:
    """A file with one mesh.

    Args:
        image: The encoded texture.
        rgba: Colour that the texture is multiplied with, sRGB.
    """
    assert shape.uv is not None
    views, accessors, data = [], [], bytearray()

    def add(content: bytes, target: int | None = None) -> int:
        data.extend(b"\0" * (-len(data) % 4))
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)} | ({"target": target} if target else {}))
        data.extend(content)
        return len(views) - 1

    def array(values: np.ndarray, kind: str, component: int, target: int) -> int:
        accessor = {"bufferView": add(values.tobytes(), target), "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        accessors.append(accessor)
        return len(accessors) - 1

    attributes = {
        "POSITION": array(np.ascontiguousarray(shape.vertices, "<f4"), "VEC3", _FLOAT, _VERTICES),
        "NORMAL": array(np.ascontiguousarray(shape.normals, "<f4"), "VEC3", _FLOAT, _VERTICES),
        "TEXCOORD_0": array(np.ascontiguousarray(shape.uv, "<f4"), "VEC2", _FLOAT, _VERTICES),
    }
    indices = array(np.ascontiguousarray(shape.faces, "<u4").reshape(-1), "SCALAR", _UINT, _FACES)
    material: dict[str, object] = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear(rgba[:3]), float(rgba[3])],
            "baseColorTexture": {"index": 0},
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
    }
    if rgba[3] < 1:
        material["alphaMode"] = "BLEND"
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [material],
        "textures": [{"source": 0}],
        "images": [{"bufferView": add(image), "mimeType": mime}],
        "bufferViews": views,
        "accessors": accessors,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data.extend(b"\0" * (-len(data) % 4))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + bytes(data)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
