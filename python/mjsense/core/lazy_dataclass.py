# SPDX-License-Identifier: Apache-2.0
"""A variant of ``dataclasses.dataclass`` that generates methods when one of them is first used.

The standard one compiles all methods at import. There are sixty configuration classes, and a program uses about five of them.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar, dataclass_transform, overload

from mjsense.core.errors import unexpected_keyword

T = TypeVar("T", bound=type)


@overload
def dataclass(cls: T, /) -> T: ...
@overload
def dataclass(*, frozen: bool = False) -> Callable[[T], T]: ...
@dataclass_transform(field_specifiers=(dataclasses.field,))
def dataclass(cls: Any = None, /, *, frozen: bool = False) -> Any:
    """Like ``dataclasses.dataclass``; the functions of ``dataclasses`` accept these classes."""
    if cls is None:
        return lambda cls: _declare(cls, frozen)
    return _declare(cls, frozen)


def _declare(cls: type, frozen: bool) -> type:
    dataclasses.dataclass(init=False, repr=False, eq=False, frozen=frozen)(cls)
    if not frozen:
        cls.__hash__ = None  # type: ignore[assignment]
    for name in ("__init__", "__repr__", "__eq__", "__hash__"):
        if name not in vars(cls):
            setattr(cls, name, _Method(cls, name, frozen))
    return cls


class _Method:
    """Placeholder of a method. The first look-up of any of them generates all missing methods."""

    def __init__(self, cls: type, name: str, frozen: bool) -> None:
        self._cls, self._name, self._frozen = cls, name, frozen

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        written = _write(self._cls, self._frozen)
        for name, value in list(vars(self._cls).items()):
            if isinstance(value, _Method):
                setattr(self._cls, name, getattr(written, name))
        return getattr(written, self._name) if instance is None else getattr(written, self._name).__get__(instance, owner)


def _write(cls: type, frozen: bool) -> type:
    """A dataclass with the same fields in the same order, including those of bases, whose methods can therefore be used."""
    fields = dataclasses.fields(cls)
    namespace: dict[str, Any] = {f.name: f for f in fields}
    namespace.update(
        __annotations__={f.name: f.type for f in fields}, __module__=cls.__module__, __qualname__=cls.__qualname__, __doc__="-"
    )
    if hasattr(cls, "__post_init__"):
        namespace["__post_init__"] = None  # the generated __init__ then calls __post_init__
    written = dataclasses.dataclass(frozen=frozen)(type(cls.__name__, (), namespace))
    written.__init__ = _known_keywords(written.__init__, cls.__name__, [f.name for f in fields if f.init])
    return written


def _known_keywords(init: Callable[..., None], cls: str, names: list[str]) -> Callable[..., None]:
    """An __init__ whose error for an unknown argument has the nearest names."""

    @functools.wraps(init)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        for name in kwargs:
            if name not in names:
                raise unexpected_keyword(f"{cls}()", name, names)
        init(self, *args, **kwargs)

    return __init__
