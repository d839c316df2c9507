# SPDX-License-Identifier: Apache-2.0
"""Assets of other formats as MJCF: meshes, textures by role, and metallic-roughness materials. trimesh reads the files."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from mjsense.core.new_output import new_output
from mjsense.core.optional import optional
from mjsense.core.srgb import decoded, encoded

if TYPE_CHECKING:
    from collections.abc import Iterator

_UP = {".glb": "y", ".gltf": "y", ".obj": "z"}
"""The suffixes that are read, and the axis that points up in such files if nothing else is said."""
_MAX_BYTES = 1 << 30
_MAX_FACES = 5_000_000
_MAX_PIXELS = 8192 * 8192
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def convert_assets(
    source: str | Path, out: str | Path, *, up: str | None = None, scale: float = 1.0, contacts: bool = True
) -> Path:
    """Writes a .glb, .gltf or .obj file as a folder with MJCF, meshes and textures.

    Materials keep their base colour, metallic, roughness, normal, occlusion, emissive and opacity textures as MuJoCo's
    texture roles. Every mesh is one visual geom; with `contacts` its convex hull takes part in contacts.

    Args:
        source: The file.
        out: The folder to make.
        up: The axis that points up in the file, ``y`` or ``z``; by default y for .glb and .gltf, z for .obj.
        scale: Metres of one unit of the file.
        contacts: Add the convex hulls of the meshes for contacts.

    Returns:
        The MJCF file.

    Raises:
        ValueError: For a file that is missing, unreadable, too large or without triangles.
        FileExistsError: If `out` exists.
    """
    source = Path(source)
    kind = source.suffix.lower()
    if kind not in _UP:
        raise ValueError(f"{source}: assets are read from files of type {', '.join(_UP)}, not '{kind}'")
    if up not in (None, "y", "z"):
        raise ValueError(f"{source}: up is '{up}': must be y or z")
    if not 0 < scale < float("inf"):
        raise ValueError(f"{source}: scale is {scale}: must be positive")
    frame = np.diag([scale, scale, scale, 1.0]) @ (_Y_UP if (up or _UP[kind]) == "y" else np.eye(4))
    for package in ("trimesh", "PIL"):
        optional(package, "convert", "Converting assets")
    with _reading(source):
        parts = list(_parts(source, frame))
    if not parts:
        raise ValueError(f"{source}: has no triangles")
    with new_output(out) as folder:
        folder.mkdir()
        writer = _Writer(source, folder)
        for vertices, faces, normals, coordinates, material in parts:
            with _reading(source, OSError):  # the disk may be full
                writer.add(vertices, faces, normals, coordinates, material, contacts)
        name = f"{_name(source.stem)}.xml"
        writer.save(folder / name)
    return Path(out) / name


def _name(text: str) -> str:
    return "".join(c if c.isalnum() and c.isascii() else "_" for c in text) or "asset"


class _Refused(ValueError):
    """An error that already names the file."""


@contextlib.contextmanager
def _reading(source: Path, *other: type[Exception]) -> Iterator[None]:
    """Errors of trimesh, Pillow and NumPy as one that names the file: they raise whatever they meet in a damaged file.

    Args:
        other: Errors that have other reasons.
    """
    try:
        yield
    except (_Refused, *other):
        raise
    except Exception as error:
        raise _Refused(f"{source}: cannot be read: {type(error).__name__}: {' '.join(str(error).split())[:200]}") from error


def _loaded(source: Path) -> Any:
    import trimesh

    if not source.is_file():
        raise _Refused(f"{source}: no such file")
    if source.stat().st_size > _MAX_BYTES:
        raise _Refused(f"{source}: has {source.stat().st_size} bytes: at most {_MAX_BYTES} are read")
    return trimesh.load_scene(source, process=False)


def _parts(source: Path, frame: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None, Any]]:
    """Vertices, faces, normals, texture coordinates and material of each mesh, in the frame of the MJCF."""
    scene = _loaded(source)
    faces = 0
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not len(getattr(mesh, "faces", ())):
            continue
        faces += len(mesh.faces)
        if faces > _MAX_FACES:
            raise _Refused(f"{source}: has more than {_MAX_FACES} triangles")
        mesh = mesh.copy()
        mesh.apply_transform(frame @ transform)
        if not np.isfinite(mesh.vertices).all():
            raise _Refused(f"{source}: mesh '{geometry}' has vertices that are not finite")
        visual = mesh.visual
        coordinates = getattr(visual, "uv", None)
        yield mesh.vertices, mesh.faces, _normals(mesh.vertices, mesh.faces), coordinates, visual


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Means over the faces of each vertex; files have several vertices where an edge is sharp."""
    corners = vertices[faces]
    out = np.zeros_like(vertices)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for corner in range(3):
        np.add.at(out, faces[:, corner], across)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.where(length > 0, out / np.maximum(length, 1e-300), (0, 0, 1))


class _Writer:
    def __init__(self, source: Path, folder: Path) -> None:
        self._source, self._folder = source, folder
        self._root = ElementTree.Element("mujoco", model=_name(source.stem))
        ElementTree.SubElement(self._root, "compiler", meshdir=".", texturedir=".")
        self._assets = ElementTree.SubElement(self._root, "asset")
        world = ElementTree.SubElement(self._root, "worldbody")
        self._body = ElementTree.SubElement(world, "body", name=_name(source.stem))
        self._files: dict[str, str] = {}
        """Names of textures by their content."""
        self._materials: dict[int, str] = {}
        self._count = 0

    def add(
        self,
        vertices: np.ndarray,
        faces: np.ndarray,
        normals: np.ndarray,
        coordinates: np.ndarray | None,
        visual: Any,
        contacts: bool,
    ) -> None:
        name = f"mesh_{self._count}"
        self._count += 1
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices]
        lines += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in normals]
        if coordinates is not None and len(coordinates) == len(vertices):
            lines += [f"vt {u:.6g} {v:.6g}" for u, v in coordinates]
            corner = "{0}/{0}/{0}"
        else:
            corner = "{0}//{0}"
        lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in faces]
        (self._folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
        # A shell: surfaces that are open or flat have no volume.
        ElementTree.SubElement(self._assets, "mesh", name=name, file=f"{name}.obj", inertia="shell")
        look = {"type": "mesh", "mesh": name, "contype": "0", "conaffinity": "0", "group": "2"}
        ElementTree.SubElement(self._body, "geom", {**look, **self._look(visual)})
        if contacts and _has_volume(vertices):
            ElementTree.SubElement(self._body, "geom", type="mesh", mesh=name, group="3")

    def _look(self, visual: Any) -> dict[str, str]:
        material = getattr(visual, "material", None)
        if material is None:
            return {"rgba": _numbers(np.asarray(visual.main_color, float) / 255)}
        if id(material) not in self._materials:
            self._materials[id(material)] = self._add_material(material.to_pbr() if hasattr(material, "to_pbr") else material)
        return {"material": self._materials[id(material)]}

    def _add_material(self, material: Any) -> str:
        name = f"material_{len(self._materials)}"
        factor = _factor(material.baseColorFactor, 4)
        see_through = material.alphaMode in ("BLEND", "MASK")
        out = ElementTree.SubElement(self._assets, "material", name=name)
        if not see_through:
            factor[3] = 1
        out.set("rgba", _numbers(np.append(encoded(factor[:3]), factor[3])))
        out.set("metallic", f"{_share(material.metallicFactor):.4g}")
        out.set("roughness", f"{_share(material.roughnessFactor):.4g}")
        colours = material.baseColorTexture
        if colours is not None:
            pixels = self._pixels(colours, "RGBA")
            self._add_layer(out, "rgb", pixels[..., :3])
            if see_through:
                alpha = pixels[..., 3]
                if material.alphaMode == "MASK":
                    alpha = np.where(alpha >= 255 * _share(material.alphaCutoff, 0.5), 255, 0).astype(np.uint8)
                self._add_layer(out, "opacity", np.repeat(alpha[..., None], 3, -1))
        if (rough := material.metallicRoughnessTexture) is not None:
            orm = self._pixels(rough, "RGB").copy()
            orm[..., 0] = 255
            if (occlusion := material.occlusionTexture) is not None:
                orm[..., 0] = self._pixels(occlusion.resize(rough.size), "RGB")[..., 0]
            self._add_layer(out, "orm", orm, linear=True)
        elif material.occlusionTexture is not None:
            self._add_layer(out, "occlusion", self._pixels(material.occlusionTexture, "RGB"), linear=True)
        if material.normalTexture is not None:
            self._add_layer(out, "normal", self._pixels(material.normalTexture, "RGB"), linear=True)
        light = _factor(material.emissiveFactor, 3, 0)
        if light.any():
            glow = np.full((1, 1, 3), 255, np.uint8)
            if material.emissiveTexture is not None:
                glow = self._pixels(material.emissiveTexture, "RGB")
            strength = light.max()
            glow = np.round(255 * encoded(decoded(glow / 255) * light / strength)).astype(np.uint8)
            out.set("emission", f"{strength:.4g}")
            self._add_layer(out, "emissive", glow)
        return name

    def _pixels(self, image: Any, mode: str) -> np.ndarray:
        if image.size[0] * image.size[1] > _MAX_PIXELS:
            raise _Refused(
                f"{self._source}: a texture has {image.size[0]} x {image.size[1]} pixels: at most {_MAX_PIXELS} are read"
            )
        with _reading(self._source):  # Pillow decodes here, and calls what is damaged an OSError
            return np.asarray(image.convert(mode))

    def _add_layer(self, material: ElementTree.Element, role: str, pixels: np.ndarray, linear: bool = False) -> None:
        from PIL import Image

        key = hashlib.sha256(pixels.tobytes() + str((pixels.shape, linear)).encode()).hexdigest()
        if key not in self._files:
            name = self._files[key] = f"texture_{len(self._files)}"
            Image.fromarray(np.ascontiguousarray(pixels)).save(self._folder / f"{name}.png")
            space = {"colorspace": "linear"} if linear else {}
            ElementTree.SubElement(self._assets, "texture", {"name": name, "type": "2d", "file": f"{name}.png", **space})
        ElementTree.SubElement(material, "layer", texture=self._files[key], role=role)

    def save(self, path: Path) -> None:
        ElementTree.indent(self._root)
        ElementTree.ElementTree(self._root).write(path)


def _has_volume(vertices: np.ndarray) -> bool:
    """Whether the points have a convex hull that is not flat."""
    spread = np.linalg.svd(vertices - vertices.mean(0), compute_uv=False)
    return len(vertices) >= 4 and spread[-1] > 1e-4 * spread[0]


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{x:.4g}" for x in values)


def _factor(value: Any, size: int, default: float = 1) -> np.ndarray:
    """A colour factor of trimesh, integers of 255 or numbers of 1, of which glTF says that they are linear."""
    out = np.full(size, default, float)
    if value is not None:
        given = np.asarray(value)
        given = given / 255 if np.issubdtype(given.dtype, np.integer) else given
        out[: len(given)] = given[:size]
    return np.maximum(out, 0)


def _share(value: float | None, default: float = 1) -> float:
    return float(np.clip(default if value is None else value, 0, 1))
