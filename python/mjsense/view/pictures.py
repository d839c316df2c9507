# SPDX-License-Identifier: Apache-2.0
"""Images of cameras in the viewer's panel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mjsense._show import coloured

_MAX_WIDTH = 320  # pixels; larger images are thinned out


class Pictures:
    """Images that the user chooses by name. Only these are read."""

    def __init__(self, gui: Any, names: list[str], later: Callable[[Any, Callable[[], None]], None], chosen: Callable[[], None], shown: int = 1) -> None:
        """
        Args:
            chosen: Called after the choice has changed.
            shown: Number of images that are chosen at first.
        """
        self._gui, self._chosen = gui, chosen
        self._panels: dict[str, Any] = {}
        self._boxes = {}
        for i, name in enumerate(names):
            box = gui.add_checkbox(name, initial_value=i < shown)
            later(box, self._choose)
            self._boxes[name] = box
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
                if self._folder is not None:
                    with self._folder:
                        self._gui.add_markdown(f"{name}: {error}")
                continue
            step = -(-image.shape[1] // _MAX_WIDTH)
            pixels = coloured((image[..., None] if image.ndim == 2 else image)[::step, ::step])
            if pixels is None:
                continue
            if name in self._panels:
                self._panels[name].image = pixels
            elif self._folder is not None:
                with self._folder:
                    self._panels[name] = self._gui.add_image(pixels, label=name, format="jpeg", jpeg_quality=85)
