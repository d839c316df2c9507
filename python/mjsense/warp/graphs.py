# SPDX-License-Identifier: Apache-2.0
"""CUDA graphs of functions that launch kernels only."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp


class Graphs:
    """One graph for each function, by name.

    Args:
        device: Where the functions run.
        enabled: Without graphs, every call of run() is a call of the function. Warp captures graphs on its CPU device too, where
            they are of use for tests only.
    """

    def __init__(self, device: Any, enabled: bool) -> None:
        self._device, self.enabled = device, enabled
        self._graphs: dict[str, Any] = {}

    def run(self, name: str, function: Callable[[], None]) -> None:
        """Calls the function, as a graph from the second call on."""
        with wp.ScopedDevice(self._device):
            if not self.enabled:
                function()
            elif name not in self._graphs:
                function()  # compiles the kernels and allocates
                self._graphs[name] = None
            else:
                if self._graphs[name] is None:
                    with wp.ScopedCapture(device=self._device) as capture:
                        function()
                    self._graphs[name] = capture.graph
                wp.capture_launch(self._graphs[name])

    def clear(self) -> None:
        """Forgets the graphs, because arrays or the functions' kernels have changed."""
        self._graphs.clear()
