# SPDX-License-Identifier: Apache-2.0
"""A guard of objects that one thread at a time can use."""

from __future__ import annotations

import functools
import os
import threading
import weakref
from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


class OneThread:
    """``with guard:`` raises RuntimeError while another thread is inside; ``with guard.lock:`` waits for it.

    The same thread may enter several times, as a signal handler does.
    """

    def __init__(self, message: str) -> None:
        self.message = message
        self.lock = threading.RLock()
        _guards.add(self)

    def __enter__(self) -> None:
        if not self.lock.acquire(blocking=False):
            raise RuntimeError(self.message)

    def __exit__(self, *_: object) -> None:
        self.lock.release()


def guarded(method: F) -> F:
    """Decorates a method of an object with a `_guard`: it runs inside the guard."""

    @functools.wraps(method)
    def call(*args: Any, **kwargs: Any) -> Any:
        with args[0]._guard:
            return method(*args, **kwargs)

    return cast(F, call)


_guards: weakref.WeakSet[OneThread] = weakref.WeakSet()


def _renew() -> None:
    for guard in list(_guards):
        guard.lock = threading.RLock()  # a thread that held it does not exist in the child of a fork


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)
