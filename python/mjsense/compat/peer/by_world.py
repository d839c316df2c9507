# SPDX-License-Identifier: Apache-2.0
"""Lists with a value for each world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


class ByWorld(Sequence):
    """The values of ``read(world)``, each read on access."""

    def __init__(self, num_worlds: int, read: Callable[[int], Any]) -> None:
        self._num_worlds, self._read = num_worlds, read

    def __len__(self) -> int:
        return self._num_worlds

    def __getitem__(self, world: Any) -> Any:
        found = range(self._num_worlds)[world]
        return self._read(found) if isinstance(found, int) else [self._read(w) for w in found]
