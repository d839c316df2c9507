# SPDX-License-Identifier: Apache-2.0
"""Old names: modules, names at the top of ``mjsense``, arguments and their order. They work for one version, with a warning that
gives the new one."""

from __future__ import annotations

import functools
import importlib
import sys
import warnings
from collections.abc import Callable
from types import ModuleType
from typing import Any, TypeVar, cast

from mjsense.core.errors import did_you_mean

T = TypeVar("T", bound=Callable[..., Any])

OLD_NAMES = {
    "mjsense.assets": "mjsense.tasks.assets",
    "mjsense.configs": "mjsense.sensors.configs",
    "mjsense.data": "mjsense.sensors.data",
    "mjsense.effects": "mjsense.sensors.effects",
    "mjsense.errors": "mjsense.core.errors",
    "mjsense.export": "mjsense.exporting",
    "mjsense.observations": "mjsense.sensors.observations",
    "mjsense.rendering": "mjsense.sim",
    "mjsense.rl": "mjsense.tasks.rl",
    "mjsense.rl.rsl": "mjsense.tasks.rl.rsl",
    "mjsense.rl.sb3": "mjsense.tasks.rl.sb3",
    "mjsense.teleoperation": "mjsense.tasks.teleoperation",
}

ROOMS = (
    "mjsense.tasks",
    "mjsense.sensors",
    "mjsense.dataset",
    "mjsense.exporting",
    "mjsense.recording",
    "mjsense.scene",
    "mjsense.sim",
    "mjsense.viewer",
)
"""Modules whose public names ``mjsense`` has too, with a warning. If two of them have a name, it is that of the first one."""


class _OldModule(ModuleType):
    """Looks up every name in the new module, which is imported then."""

    def __init__(self, old: str, new: str) -> None:
        super().__init__(old, f"The old name of :mod:`{new}`.")
        self._new = new

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__all__":  # looked up in every module by tools that inspect them
            raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")
        warnings.warn(f"{self.__name__} is now {self._new}", DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(self._new), name)


def register() -> None:
    """Makes ``import`` find the old names. A public name of a package, such as ``mjsense.effects``, stays what it is."""
    for old, new in OLD_NAMES.items():
        module = sys.modules.setdefault(old, _OldModule(old, new))
        package, _, name = old.rpartition(".")
        vars(sys.modules[package]).setdefault(name, module)


def moved_name(name: str) -> Any:
    """The value of an old public name of ``mjsense``, for its ``__getattr__``.

    Raises:
        AttributeError: There is no such name.
    """
    room = next((room for room in ROOMS if name in importlib.import_module(room).__all__), None)
    if room is None:
        near = "" if name.startswith("_") else did_you_mean(name, sys.modules["mjsense"].__all__)
        raise AttributeError(f"module 'mjsense' has no attribute '{name}'{near}")
    warnings.warn(f"mjsense.{name} is now {room}.{name}", DeprecationWarning, stacklevel=3)
    return getattr(importlib.import_module(room), name)


def old_argument(old: str, new: str) -> Callable[[T], T]:
    """Decorates a function, or a class, whose keyword argument ``old`` is now ``new``."""

    def decorate(target: T) -> T:
        if isinstance(target, type):
            cls: Any = target
            cls.__init__ = decorate(cls.__init__)
            return cast(T, cls)
        function: Any = target
        context = function.__qualname__.removesuffix(".__init__")

        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            if old in kwargs and new not in kwargs:
                warnings.warn(f"{context}(): the argument {old} is now {new}", DeprecationWarning, stacklevel=2)
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return cast(T, call)

    return decorate


def old_order(
    old: str, new: str, names: tuple[str, ...], is_old: Callable[[tuple[Any, ...], dict[str, Any]], bool]
) -> Callable[[T], T]:
    """Decorates a function, or a class, whose positional arguments have another order now.

    Args:
        old: The call with the old order, ``"f(out, root)"``.
        new: The call with the new one.
        names: All positional arguments in the old order.
        is_old: Whether given positional arguments, of which there is at least one, and keyword arguments have the old order.
    """

    def decorate(target: T) -> T:
        if isinstance(target, type):
            cls: Any = target
            cls.__init__ = decorate(cls.__init__)
            return cast(T, cls)
        function: Any = target
        start = 1 if function.__qualname__.endswith(".__init__") else 0

        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            given = args[start:]
            if 0 < len(given) <= len(names) and is_old(given, kwargs):
                warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=2)
                return function(*args[:start], **dict(zip(names, given)), **kwargs)
            return function(*args, **kwargs)

        return cast(T, call)

    return decorate
