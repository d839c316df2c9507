# SPDX-License-Identifier: Apache-2.0
"""Attributes of HDF5 objects, and errors of the HDF5 library with the place."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from mjsense.core.errors import UnknownNameError
from mjsense.core.optional import optional
from mjsense.dataset import limits
from mjsense.dataset.places import printable

ERRORS = (KeyError, OSError, RuntimeError, ValueError, TypeError, OverflowError, MemoryError)


def text_of(value: Any) -> str:
    """A text attribute or a text dataset's value; a row of bytes ends at the first 0."""
    if isinstance(value, str):
        return value
    return bytes(value).split(b"\0", 1)[0].decode(errors="replace")


class Attributes:
    """Attributes of an object: texts, numbers, and small arrays of numbers."""

    def __init__(self, owner: Any, place: str) -> None:
        self._owner, self._place = owner, place

    def __contains__(self, name: str) -> bool:
        with reading(self._place):
            return name in self._owner.attrs

    def get(self, name: str, default: Any = None) -> Any:
        """The value, or the default if there is no such attribute."""
        if name not in self:
            return default
        attributes = self._owner.attrs
        what = f"{self._place}: the attribute '{name}'"
        with reading(what):
            about = attributes.get_id(name)
            size = int(np.prod(about.shape or (), dtype=np.float64)) * about.dtype.itemsize
            if about.dtype.kind not in "biufSO" or size > limits.DESCRIPTION_BYTES:
                raise ValueError(f"is of an unknown type or has more than {limits.DESCRIPTION_BYTES} bytes")
            if about.dtype.kind == "O" and (about.shape or about.get_type().get_class() != string_class()):
                raise ValueError("is neither a text nor numbers")
            value = attributes[name]
            if isinstance(value, (str, bytes)) and len(value) > limits.DESCRIPTION_BYTES:
                raise ValueError(f"has {len(value)} bytes, more than {limits.DESCRIPTION_BYTES}")
        return value

    def __getitem__(self, name: str) -> Any:
        if (value := self.get(name)) is None:
            raise UnknownNameError(f"{self._place} has no attribute '{name}'")
        return value

    def text(self, name: str, default: str = "", most: int = limits.TEXT_BYTES) -> str:
        """A text of at most so many bytes."""
        value = self.get(name)
        if value is None:
            return default
        if not isinstance(value, (str, bytes)):
            raise ValueError(f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}, not a text")
        if len(value) > most:
            raise ValueError(f"{self._place}: the attribute '{name}' has {len(value)} bytes, more than {most}")
        return text_of(value)

    def integer(self, name: str, low: int, high: int) -> int | None:
        """A whole number in these bounds; None if there is no such attribute."""
        value = self.get(name)
        if value is None:
            return None
        if not isinstance(value, np.integer) or not low <= int(value) <= high:
            raise ValueError(
                f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}; it must be a whole number "
                f"from {low} to {high}"
            )
        return int(value)

    def number(self, name: str, default: float) -> float:
        """A finite number that is not negative."""
        value = self.get(name, default)
        if not isinstance(value, (float, np.floating, np.integer)) or not 0 <= float(value) < np.inf:
            raise ValueError(
                f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}; it must be a finite "
                "number of at least 0"
            )
        return float(value)


def string_class() -> int:
    return optional("h5py.h5t", "dataset", "Reading recordings").STRING


@contextlib.contextmanager
def reading(where: str) -> Iterator[None]:
    """Errors of the HDF5 library and of the checks, with the place."""
    try:
        yield
    except ERRORS as error:
        text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
        raise ValueError(
            f"{where} {text}" if not isinstance(error, (KeyError, OSError, RuntimeError)) else f"{where} cannot be read: {text}"
        ) from None
