# SPDX-License-Identifier: Apache-2.0
"""A cache that drops what was used least recently, by size."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any


class Cache:
    """Values by key, at most ``limit`` bytes (the newest value always stays). A pickled cache is empty; a forked one has its own
    lock.

    ``per_process`` says that values cannot be used in a forked process.
    """

    def __init__(self, limit: int, per_process: bool = False) -> None:
        self._limit, self._per_process = limit, per_process
        self._clear()

    def _clear(self) -> None:
        self._values: OrderedDict[Any, tuple[Any, int]] = OrderedDict()
        self._size = 0
        self._pid, self._lock = os.getpid(), threading.RLock()

    def __getstate__(self) -> tuple[int, bool]:
        return self._limit, self._per_process

    def __setstate__(self, state: tuple[int, bool]) -> None:
        self.__init__(*state)

    @property
    def lock(self) -> Any:
        """For callers that fill the cache in several steps."""
        if self._pid != os.getpid():
            self._pid, self._lock = os.getpid(), threading.RLock()  # another thread of the parent may have held the lock
            if self._per_process:
                self._clear()
        return self._lock

    def find(self, key: Any) -> Any:
        """The value, or None."""
        with self.lock:
            found = self._values.get(key)
            if found is None:
                return None
            self._values.move_to_end(key)
            return found[0]

    def add(self, key: Any, value: Any, size: int) -> None:
        with self.lock:
            if key in self._values:
                self._size -= self._values.pop(key)[1]
            self._values[key] = value, size
            self._size += size
            while self._size > self._limit and len(self._values) > 1:
                self._size -= self._values.popitem(last=False)[1][1]

    def get(self, key: Any, make: Callable[[], tuple[Any, int]]) -> Any:
        """The value; ``make`` returns it and its size if it is not there."""
        value = self.find(key)
        if value is None:
            value, size = make()
            self.add(key, value, size)
        return value
