# SPDX-License-Identifier: Apache-2.0
"""Visualisation of sensor measurements as shapes in the world frame, for any viewer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core.arguments import KnownAttributes, checked

if TYPE_CHECKING:
    import mujoco

_GEOMS = ("sphere", "arrow", "line", "cylinder")
_AXES = ((0.9, 0.0, 0.0), (0.0, 0.9, 0.0), (0.0, 0.0, 0.9))


@checked
class DebugShapes(KnownAttributes):
    """Spheres, arrows, lines and cylinders in the world frame, as NumPy arrays with one row per shape.

    ``draw(scene)`` adds them to a MuJoCo scene; the arrays serve all other viewers. This class is also the visualizer passed to
    ``debug_vis(visualizer)`` of sensors written in Python, with mjlab's methods.
    """

    def __init__(self, world: int = 0, meansize: float = 0.1) -> None:
        self.env_idx = world
        """Id of the world that is drawn."""
        self.meansize = meansize
        """The model's ``stat.meansize``, m: a reference length for shapes."""
        self._blocks: list[tuple[Any, ...]] = []
        self._complete = True

    def __len__(self) -> int:
        return len(self.kinds)

    def __repr__(self) -> str:
        kinds, counts = np.unique(self.kinds, return_counts=True)
        shown = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts))
        return f"<shapes of world {self.env_idx}: {shown or 'none'}>"

    # ---------------------------------------------------------------------------------------------------------- as data

    @property
    def kinds(self) -> np.ndarray:
        """``"sphere"``, ``"arrow"``, ``"line"`` or ``"cylinder"``: str ``[n]``."""
        return self._column(0, np.zeros(0, "U8"))

    @property
    def positions(self) -> np.ndarray:
        """Centres of spheres and start points of other shapes: float64 ``[n, 3]`` m, world frame."""
        return self._column(1, np.zeros((0, 3)))

    @property
    def vectors(self) -> np.ndarray:
        """Vectors from start to end point: float64 ``[n, 3]`` m, world frame; 0 for spheres."""
        return self._column(2, np.zeros((0, 3)))

    @property
    def widths(self) -> np.ndarray:
        """Radii in m, or widths in pixels for lines: float64 ``[n]``."""
        return self._column(3, np.zeros(0))

    @property
    def rgba(self) -> np.ndarray:
        """Colours, 0 to 1: float32 ``[n, 4]``."""
        return self._column(4, np.zeros((0, 4), np.float32))

    @property
    def labels(self) -> list[str]:
        """Names of the shapes: ``feet_FR_foot_0_force``."""
        return [label for block in self._blocks for label in block[5]]

    def of(self, kind: str) -> DebugShapes:
        """The shapes of one kind."""
        if kind not in _GEOMS:
            raise ValueError(f"no shape is a '{kind}'; kinds are {', '.join(_GEOMS)}")
        chosen = self.kinds == kind
        part = DebugShapes(self.env_idx, self.meansize)
        labels = [label for label, keep in zip(self.labels, chosen) if keep]
        places = self.positions[chosen], self.vectors[chosen]
        part._extend(self.kinds[chosen], *places, self.widths[chosen], self.rgba[chosen], labels)
        return part

    # ---------------------------------------------------------------------------------------------------- in MuJoCo's scenes

    def draw(self, scene: mujoco.MjvScene, labels: bool = False) -> int:
        """Appends the shapes to a scene (``renderer.scene``, ``viewer.user_scn``), optionally with their labels as text.

        Returns the number of shapes that did not fit; a scene holds ``maxgeom`` geoms.
        """
        # Duplicates the C++ function DebugShapes::append_to, because MuJoCo's Python bindings give no pointer to a scene.
        import mujoco  # the one that made the scene, of any series

        room = min(len(self), max(0, scene.maxgeom - scene.ngeom))
        geoms, identity = scene.geoms[scene.ngeom : scene.ngeom + room], np.eye(3).ravel()
        rows = zip(geoms, self.kinds, self.positions, self.positions + self.vectors, self.widths, self.rgba, self.labels)
        for geom, kind, start, end, width, rgba, label in rows:
            shape = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
            mujoco.mjv_initGeom(geom, shape, np.full(3, width), start, identity, rgba)
            if kind != "sphere":
                mujoco.mjv_connector(geom, shape, width, start, end)
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR
            if labels:
                geom.label = label[:99]
        scene.ngeom += room
        return len(self) - room

    # --------------------------------------------------------------------------------------------- as mjlab's visualizer

    def add_sphere(self, center: Any, radius: float, color: Sequence[float], label: str | None = None) -> None:
        self._add("sphere", center, center, radius, color, label)

    def add_arrow(self, start: Any, end: Any, color: Sequence[float], width: float = 0.015, label: str | None = None) -> None:
        self._add("arrow", start, end, width, color, label)

    def add_cylinder(self, start: Any, end: Any, radius: float, color: Sequence[float], label: str | None = None) -> None:
        self._add("cylinder", start, end, radius, color, label)

    def add_line(self, start: Any, end: Any, color: Sequence[float], width: float = 2.0, label: str | None = None) -> None:
        """Adds a line; ``width`` is in pixels."""
        self._add("line", start, end, width, color, label)

    def add_frame(
        self,
        position: Any,
        rotation_matrix: Any,
        scale: float = 0.3,
        label: str | None = None,
        axis_radius: float = 0.01,
        alpha: float = 1.0,
        axis_colors: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Adds a frame as three arrows of length `scale`: x red, y green, z blue, labelled ``<label>_x`` ..."""
        rotation = np.asarray(rotation_matrix, np.float64).reshape(3, 3)
        for k, color in enumerate(axis_colors or _AXES):
            end = np.asarray(position) + scale * rotation[:, k]
            self.add_arrow(position, end, (*color[:3], alpha), axis_radius, f"{label}_{'xyz'[k]}" if label else None)

    def clear(self) -> None:
        """Removes all shapes."""
        self._blocks.clear()

    # ------------------------------------------------------------------------------------------------------------ inside

    def _add(self, kind: str, start: Any, end: Any, width: float, color: Sequence[float], label: str | None) -> None:
        start, end = np.array(start, np.float64).reshape(1, 3), np.array(end, np.float64).reshape(1, 3)
        rgba = np.array(color, np.float32)
        if rgba.shape != (4,):
            raise ValueError(f"color must be (r, g, b, a), not {color!r}")
        self._extend([kind], start, end - start, [width], rgba[None], [label or ""])

    def _extend(self, kinds: Any, positions: Any, vectors: Any, widths: Any, rgba: Any, labels: list[str]) -> None:
        self._blocks.append((np.array(kinds, "U8"), positions, vectors, np.asarray(widths, np.float64), rgba, labels))

    def _column(self, i: int, empty: np.ndarray) -> np.ndarray:
        return np.concatenate([empty, *(block[i] for block in self._blocks)])
