# SPDX-License-Identifier: Apache-2.0
"""Fields of mjData of all worlds as tensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mjsense.compat.mjlab._tensors import Cache

if TYPE_CHECKING:
    import mjsense


class Data:
    """Fields of mjData, for example ``sim.data.qpos``: ``[B, nq]`` float64, shares the worlds' memory.

    Write the state (qpos, qvel, ctrl ...), then call ``forward()``.
    """

    def __init__(self, native: mjsense.Simulation) -> None:
        self._native = native
        self._tensors = Cache()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name == "time":
            return self._tensors(name, self._native.time)
        return self._tensors(name, getattr(self._native.data, name))
