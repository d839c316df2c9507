# SPDX-License-Identifier: Apache-2.0
"""Debug shapes in the browser."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.sensors.drawing import DebugShapes
from mjsense.viewer import geometry

_ROUND_LIMIT = 400  # spheres; more of them are drawn as points


class ShapeLayer:
    """Draws spheres, arrows, lines and cylinders, one node for each kind."""

    def __init__(self, server: Any, node: str = "/shapes") -> None:
        self._server, self._node = server, node
        self._nodes: list[Any] = []

    def show(self, shapes: DebugShapes) -> None:
        """Replaces the shapes that are shown."""
        with self._server.atomic():
            old, self._nodes = self._nodes, []
            for kind, add in (
                ("sphere", self._spheres),
                ("arrow", self._arrows),
                ("line", self._lines),
                ("cylinder", self._cylinders),
            ):
                part = shapes.of(kind)
                if len(part):
                    self._nodes.append(add(f"{self._node}/{kind}", part))
            kept = {node.name for node in self._nodes}
            for node in old:
                if node.name not in kept:  # adding a node of the same name has replaced the others
                    node.remove()

    def _spheres(self, name: str, part: DebugShapes) -> Any:
        colours = _bytes(part.rgba)
        if len(part) > _ROUND_LIMIT:
            return self._server.scene.add_point_cloud(
                name, part.positions.astype(np.float32), colours, point_size=float(2 * part.widths.mean()), point_shape="circle"
            )
        ball = geometry.welded(geometry.unit_sphere())
        turns = np.tile([1.0, 0, 0, 0], (len(part), 1))
        return self._server.scene.add_batched_meshes_simple(
            name,
            ball.vertices,
            ball.faces,
            turns,
            part.positions,
            batched_scales=part.widths,
            batched_colors=colours,
            cast_shadow=False,
            receive_shadow=False,
            lod="off",
        )

    def _arrows(self, name: str, part: DebugShapes) -> Any:
        ends = np.stack([part.positions, part.positions + part.vectors], 1).astype(np.float32)
        width = float(part.widths.mean())
        return self._server.scene.add_arrows(
            name, ends, _bytes(part.rgba), shaft_radius=width, head_radius=2 * width, head_length=4 * width
        )

    def _lines(self, name: str, part: DebugShapes) -> Any:
        ends = np.stack([part.positions, part.positions + part.vectors], 1).astype(np.float32)
        return self._server.scene.add_line_segments(
            name, ends, np.repeat(_bytes(part.rgba)[:, None], 2, 1), line_width=float(part.widths.mean())
        )

    def _cylinders(self, name: str, part: DebugShapes) -> Any:
        rod = geometry.welded(geometry.unit_cylinder())
        lengths = np.linalg.norm(part.vectors, axis=1)
        scales = np.stack([part.widths, part.widths, np.maximum(lengths, 1e-9) / 2], 1)
        turns = np.array([_turn(vector) for vector in part.vectors])
        return self._server.scene.add_batched_meshes_simple(
            name,
            rod.vertices,
            rod.faces,
            turns,
            part.positions + part.vectors / 2,
            batched_scales=scales,
            batched_colors=_bytes(part.rgba),
            cast_shadow=False,
            lod="off",
        )


def _bytes(rgba: np.ndarray) -> np.ndarray:
    return (np.clip(rgba[:, :3], 0, 1) * 255).round().astype(np.uint8)


def _turn(vector: np.ndarray) -> np.ndarray:
    """Quaternion that turns the z axis into the direction of a vector."""
    length = float(np.linalg.norm(vector))
    direction = vector / length if length > 0 else np.array([0.0, 0, 1])
    if direction[2] < -1 + 1e-9:
        return np.array([0.0, 1, 0, 0])
    half = np.array([1 + direction[2], -direction[1], direction[0], 0.0])
    return half / np.linalg.norm(half)
