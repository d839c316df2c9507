# SPDX-License-Identifier: Apache-2.0
"""Objects that the package scene_synthesizer generates, as MJCF files.

``python -m mjsense.tasks.synthesized_objects FOLDER`` writes them. ``mjsense assets install scene_synthesizer`` runs it with the
package and its dependencies in a temporary folder. Pictures show the meshes of the package. Contacts are with boxes, a cylinder
and convex hulls of sections of those meshes.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

STAVES = 12  # boxes around a hollow object
WHITE, BLACK, STEEL, BRASS = "0.92 0.91 0.88 1", "0.08 0.08 0.09 1", "0.62 0.64 0.67 1", "0.78 0.6 0.25 1"
RED, YELLOW, GREEN, BLUE = "0.72 0.2 0.16 1", "0.9 0.78 0.35 1", "0.2 0.42 0.26 1", "0.35 0.5 0.66 1"
BROWN, AMBER, CLEAR = "0.5 0.33 0.2 1", "0.83 0.62 0.2 1", "0.72 0.86 0.9 0.45"
GREEN_GLASS, BLUE_GLASS = "0.4 0.66 0.5 0.5", "0.5 0.6 0.85 0.5"
_HOLLOW = dict(thickness=0.006, bottom_flatness_radius=0.025)
_ROUND = dict(num_segments_curvature=16, num_segments_cross_section=12)
_SQUARE = dict(num_segments_curvature=16, num_segments_cross_section=4)

# Class of the package, colour and parameters of each object; lengths are in metres.
OBJECTS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "mug": ("Mug", RED, _HOLLOW | dict(width=0.074, height=0.088, handle_height=0.062)),
    "espresso_cup": (
        "Mug",
        WHITE,
        _HOLLOW
        | dict(
            width=0.056, height=0.055, bottom_flatness_radius=0.02, handle_width=0.01, handle_height=0.038, handle_depth=0.024
        ),
    ),
    "beer_mug": ("Mug", AMBER, _HOLLOW | dict(width=0.062, height=0.13, bottom_radius_factor=1.05, handle_height=0.09)),
    "tumbler": ("Glass", CLEAR, _HOLLOW | dict(width=0.062, height=0.09, bottom_radius_factor=1.0)),
    "tall_glass": ("Glass", GREEN_GLASS, _HOLLOW | dict(width=0.058, height=0.14, bottom_radius_factor=0.9)),
    "shot_glass": (
        "Glass",
        BLUE_GLASS,
        _HOLLOW | dict(width=0.044, height=0.06, bottom_flatness_radius=0.015, bottom_radius_factor=0.9),
    ),
    "bowl": ("Bowl", YELLOW, dict(width=0.17, height=0.06, thickness=0.006)),
    "plate": ("Plate", BLUE, dict(width=0.21, height=0.022, bottom_flatness_radius=0.06, num_sections_height=16)),
    "crate": ("Bin", GREEN, dict(width=0.2, depth=0.15, height=0.05, thickness=0.006, use_primitives=True)),
    "door_knob": ("Knob", BRASS, dict(width=0.056, height=0.056, depth=0.055, knob_ratio=0.6)),
    "drawer_knob": ("Knob", WHITE, dict(width=0.036, height=0.036, depth=0.032, base_ratio=0.6)),
    "stove_knob": ("Knob", BLACK, dict(width=0.05, height=0.05, depth=0.03, base_ratio=0.9, knob_ratio=0.8, num_sections=8)),
    "square_knob": ("Knob", BROWN, dict(width=0.05, height=0.05, depth=0.04, base_ratio=0.6, knob_ratio=0.7, num_sections=4)),
    "drawer_handle": (
        "Handle",
        STEEL,
        _ROUND | dict(width=0.12, height=0.035, depth=0.014, straight_ratio=1.2, curvature_ratio=0.6),
    ),
    "arched_handle": ("Handle", BRASS, _ROUND | dict(width=0.1, height=0.04, depth=0.018, straight_ratio=0.5, curvature_ratio=1)),
    "square_handle": (
        "Handle",
        BLACK,
        _SQUARE | dict(width=0.14, height=0.035, depth=0.014, straight_ratio=1.6, curvature_ratio=0.3),
    ),
}


def _numbers(values: Any) -> str:
    return " ".join(f"{value:.5f}" for value in np.ravel(values))


def _box(points: np.ndarray, x: np.ndarray, y: np.ndarray) -> str:
    """Attributes of the box around the points, with these two axes."""
    x = x / np.linalg.norm(x)
    y = y - (y @ x) * x
    y = y / np.linalg.norm(y)
    axes = np.stack([x, y, np.cross(x, y)])
    low, high = (points @ axes.T).min(0), (points @ axes.T).max(0)
    return (
        f"type='box' pos='{_numbers((low + high) / 2 @ axes)}' xyaxes='{_numbers(axes[:2])}' size='{_numbers((high - low) / 2)}'"
    )


def _profile(mesh: Any) -> np.ndarray:
    """Radius and height of the points that a mesh is revolved from, from the axis at the bottom."""
    x, y, z = mesh.vertices.T
    seen = (np.abs(y) < 1e-9) & (x < 1e-9)
    return np.stack([-x[seen], z[seen]], 1)


def _hollow(mesh: Any, bands: int = 2) -> list[str]:
    """A bottom, and staves in bands from the bottom to the rim. Half of the profile is the outside."""
    profile = _profile(mesh)
    half = len(profile) // 2
    outside, inside = profile[:half], profile[::-1][:half]
    flat = int(np.flatnonzero(outside[:, 1] < 1e-6)[-1])
    height = inside[0, 1]
    parts = [f"type='cylinder' pos='0 0 {height / 2:.5f}' size='{outside[flat, 0]:.5f} {height / 2:.5f}'"]
    edges = np.linspace(flat, half - 1, bands + 1).round().astype(int)
    wider = np.cos(np.pi / STAVES) ** -0.5  # half of the difference between the circles in and around the staves
    for low, high in itertools.pairwise(edges):
        corners = np.concatenate([outside[[low, high]], inside[[low, high]]])
        along = (corners[1] - corners[0]) + (corners[3] - corners[2])
        for k in range(STAVES):
            middle = 2 * np.pi * k / STAVES
            angles = middle + np.pi / STAVES * np.array([[-1], [1]])
            r, z = corners[:, 0] * wider, np.broadcast_to(corners[:, 1], (2, 4))
            points = np.stack([r * np.cos(angles), r * np.sin(angles), z], -1).reshape(-1, 3)
            tangent = np.array([-np.sin(middle), np.cos(middle), 0])
            up = np.array([along[0] * np.cos(middle), along[0] * np.sin(middle), along[1]])
            parts.append(_box(points, tangent, up))
    return parts


def _bar(mesh: Any, corners: int, across: np.ndarray, pieces: int = 6) -> list[str]:
    """Boxes along a mesh that is a polygon of so many corners, swept along a path in a plane normal to ``across``."""
    sections = np.asarray(mesh.vertices).reshape(-1, corners, 3)
    ends = np.linspace(0, len(sections) - 1, pieces + 1).round().astype(int)
    return [
        _box(sections[[a, b]].reshape(-1, 3), sections[b].mean(0) - sections[a].mean(0), across)
        for a, b in itertools.pairwise(ends)
    ]


def _solid(mesh: Any, pieces: int = 4) -> Iterable[np.ndarray]:
    """Points of slices of a mesh that is revolved from a profile."""
    heights = _profile(mesh)[:, 1]
    edges = np.linspace(0, len(heights) - 1, pieces + 1).round().astype(int)
    z = mesh.vertices[:, 2]
    for a, b in itertools.pairwise(edges):
        yield mesh.vertices[(z >= heights[a] - 1e-9) & (z <= heights[b] + 1e-9)]


def _generate(kind: str, parameters: dict[str, Any]) -> Any:
    """The package's meshes as a scene of trimesh."""
    import trimesh  # pyright: ignore[reportMissingImports]
    from scene_synthesizer import procedural_assets  # pyright: ignore[reportMissingImports]

    sweep = trimesh.creation.sweep_polygon
    try:  # The package asks for the engine "triangle", whose licence excludes commercial products.
        trimesh.creation.sweep_polygon = lambda polygon, path, engine: sweep(polygon, path, engine="earcut")
        return getattr(procedural_assets, f"{kind}Asset")(**parameters).as_trimesh_scene()
    finally:
        trimesh.creation.sweep_polygon = sweep


def mjcf(name: str) -> str:
    """The MJCF file of an object of OBJECTS."""
    kind, color, parameters = OBJECTS[name]
    scene = _generate(kind, parameters)
    assets, seen, solid = [], [], []
    for node in scene.graph.nodes_geometry:
        placement, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        mesh.apply_transform(placement)
        if kind == "Bin":
            solid.append(_box(mesh.vertices, np.eye(3)[0], np.eye(3)[1]))
        elif kind == "Handle" or node.endswith("handle"):
            corners = parameters.get("num_segments_cross_section", 8)
            solid += _bar(mesh, corners, placement[:3, 2])
        elif kind == "Knob":
            for points in _solid(mesh):
                assets.append(f"<mesh name='slice_{len(assets)}' vertex='{_numbers(points)}'/>")
                solid.append(f"type='mesh' mesh='slice_{len(assets) - 1}'")
        else:
            solid += _hollow(mesh)
        number = len(seen)
        faces = " ".join(map(str, mesh.faces.ravel()))
        assets.append(f"<mesh name='seen_{number}' vertex='{_numbers(mesh.vertices)}' face='{faces}'/>")
        seen.append(f"<geom class='seen' mesh='seen_{number}'/>")
    lines = [
        f"<mujoco model='{name}'>",
        "<compiler angle='radian' autolimits='true'/>",
        "<default>",
        "<geom condim='4' solref='0.008 1' group='3'/>",
        f"<default class='seen'><geom type='mesh' group='2' contype='0' conaffinity='0' mass='0' rgba='{color}'/></default>",
        "</default>",
        "<asset>",
        *assets,
        "</asset>",
        "<worldbody>",
        "<body>",
        *seen,
        *(f"<geom {attributes}/>" for attributes in solid),
        "</body>",
        "</worldbody>",
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in OBJECTS:
        (folder / f"{name}.xml").write_text(mjcf(name))


if __name__ == "__main__":
    main()
