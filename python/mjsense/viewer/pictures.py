# SPDX-License-Identifier: Apache-2.0
"""Images of cameras in the viewer's panel."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mjsense.core.representations import coloured
from mjsense.viewer.text import label, panel_text

_MAX_WIDTH = 320  # pixels; larger images are thinned out
_POINT = np.array((255, 0, 255), np.uint8)


def point_streams(camera: str, names: Iterable[str]) -> list[str]:
    """Of these streams those with image points of a camera."""
    return [name for name in names if name.endswith(f"/{camera}/points")]


def with_points(pixels: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A copy of an image with a square of three pixels at each point.

    Args:
        pixels: uint8 [H, W, 3].
        points: Fractions of the width and the height, [N, 2]; NaN: no point.
    """
    marked = pixels.copy()
    height, width = pixels.shape[:2]
    for x, y in points[np.isfinite(points).all(1)]:
        column, row = int(x * width), int(y * height)
        marked[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = _POINT
    return marked


class Pictures:
    """Images that the user chooses by name. Only these are read."""

    def __init__(
        self,
        gui: Any,
        names: list[str],
        later: Callable[[Any, Callable[[], None]], None],
        chosen: Callable[[], None],
        shown: int = 1,
        points: Callable[[str], np.ndarray | None] = lambda _: None,
    ) -> None:
        """
        Args:
            chosen: Called after the choice has changed.
            shown: Number of images that are chosen at first.
            points: Image points of an image by its name, fractions [N, 2]; None: it never has any.
        """
        self._gui, self._chosen = gui, chosen
        self._panels: dict[str, Any] = {}
        self._errors: dict[str, Any] = {}  # texts, by the name of the image
        self._boxes = {}
        for i, name in enumerate(names):
            box = gui.add_checkbox(label(name), initial_value=i < shown)
            later(box, self._choose)
            self._boxes[name] = box
        self._points, self._points_box = points, None
        if any(points(name) is not None for name in names):
            self._points_box = gui.add_checkbox(
                "Image points", initial_value=False, hint="Pixels on objects: object_image_points."
            )
            later(self._points_box, chosen)
        self._folder = gui.add_folder("Images") if names else None
        if not names:
            gui.add_markdown("There are no images.")

    def _choose(self) -> None:
        for name, box in self._boxes.items():
            if not box.value and name in self._panels:
                self._panels.pop(name).remove()
        self._chosen()

    def refresh(self, read: Callable[[str], np.ndarray]) -> None:
        """Reads the chosen images and sends them to the browser."""
        for name, box in self._boxes.items():
            if not box.value:
                continue
            try:
                image = read(name)
            except (OSError, RuntimeError) as error:  # a video that is missing or damaged
                box.value = False
                if self._folder is not None and name not in self._errors:
                    with self._folder:
                        self._errors[name] = self._gui.add_html(panel_text("", f"{name}: {error}"))
                continue
            step = -(-image.shape[1] // _MAX_WIDTH)
            pixels = coloured((image[..., None] if image.ndim == 2 else image)[::step, ::step])
            if pixels is None:
                continue
            if self._points_box is not None and self._points_box.value:
                points = self._points(name)
                pixels = pixels if points is None else with_points(pixels, points)
            if name in self._panels:
                self._panels[name].image = pixels
            elif self._folder is not None:
                with self._folder:
                    self._panels[name] = self._gui.add_image(pixels, label=label(name), format="jpeg", jpeg_quality=85)
