# SPDX-License-Identifier: Apache-2.0
"""Sliders in the viewer's panel, which set numbers of a live world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mjsense.viewer.source import Control
from mjsense.viewer.text import label

_MAX_SLIDERS = 60


class Sliders:
    """A folder with one slider for each of the first 60 controls.

    Args:
        values: Returns the current values of the controls; called with a world.
        write: Sets the value of a control; called with its index and the value.
    """

    def __init__(
        self,
        gui: Any,
        title: str,
        controls: Sequence[Control],
        world: int,
        values: Callable[[int], np.ndarray],
        write: Callable[[int, float], None],
        later: Callable[[Any, Callable[[], None]], None],
    ) -> None:
        self._values, self._write = values, write
        self.handles: list[Any] = []
        if not controls:
            return
        with gui.add_folder(title):
            for index, (control, value) in enumerate(zip(controls[:_MAX_SLIDERS], values(world))):
                low, high = control.low, max(control.high, control.low + 1e-6)
                start, step = float(min(max(value, low), high)), (high - low) / 1000
                handle = gui.add_slider(label(control.name), min=low, max=high, step=step, initial_value=start)
                later(handle, lambda index=index: self.apply(index))
                self.handles.append(handle)

    def apply(self, index: int) -> None:
        """Sets a control to the value of its slider."""
        self._write(index, float(self.handles[index].value))

    def sync(self, world: int) -> None:
        """Moves the sliders to the current values."""
        if not self.handles:
            return
        for handle, value in zip(self.handles, self._values(world)):
            value = float(min(max(value, handle.min), handle.max))
            if abs(value - handle.value) > handle.step:
                handle.value = value
