# SPDX-License-Identifier: Apache-2.0
"""Messages of openpi's protocol: MessagePack with arrays. All that is received is data, and has limits."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np

from mjsense.core.optional import optional

MAX_BYTES = 64 << 20
"""Size of a message."""
MAX_DEPTH = 16
"""Depth to which maps and lists are nested."""
MAX_ITEMS = 4096
"""Number of items of a list or map."""
MAX_TOTAL = 65536
"""Number of items of all lists and maps of a message."""
_MAX_DIMENSIONS = 8
_TYPES = {
    f"{kind}{size}" for kind, sizes in {"b": (1,), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8), "f": (2, 4, 8)}.items() for size in sizes
}

Arrays = Literal["openpi", "msgpack_numpy"]
"""How an array is written: a map with the keys of ``openpi_client.msgpack_numpy``, or with those of the package msgpack-numpy."""


class Message(NamedTuple):
    """A message that was received."""

    value: Any
    arrays: Arrays
    """How its arrays were written; ``openpi`` if it has none."""


def pack(value: Any, arrays: Arrays = "openpi") -> bytes:
    """Maps with texts as keys, lists, numbers, texts, and numeric arrays as a message."""
    packed = _msgpack().packb(value, default=_as_openpi if arrays == "openpi" else _as_msgpack_numpy)
    if len(packed) > MAX_BYTES:
        raise ValueError(f"a message has {len(packed)} bytes, more than the limit of {MAX_BYTES}")
    return packed


def unpack(data: bytes) -> Message:
    """The contents of a message. Arrays are read-only.

    Raises:
        ValueError: It is not valid, or exceeds a limit.
    """
    if len(data) > MAX_BYTES:
        raise ValueError(f"a message has {len(data)} bytes, more than the limit of {MAX_BYTES}")
    msgpack, reader = _msgpack(), _Reader()
    try:
        parsed = msgpack.unpackb(
            data,
            object_pairs_hook=reader.count_map,
            list_hook=reader.count_list,
            ext_hook=_no_extension,
            max_array_len=MAX_ITEMS,
            max_map_len=MAX_ITEMS,
            max_ext_len=16,
        )
    except (ValueError, msgpack.UnpackException) as error:
        raise ValueError(f"not a valid message: {str(error) or type(error).__name__}") from None
    value = reader.read(parsed, 0)
    return Message(value, reader.arrays)


def _msgpack() -> Any:
    return optional("msgpack", "evaluate", "a remote policy")


def _no_extension(code: int, data: bytes) -> Any:
    raise ValueError(f"it has an extension of type {code}")


class _Reader:
    """Counts items while a message is parsed, and then makes arrays of its maps."""

    def __init__(self) -> None:
        self.arrays: Arrays = "openpi"
        self._items = 0

    def count_map(self, pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
        self.count_list(pairs)
        table = dict(pairs)
        if len(table) != len(pairs):
            raise ValueError("a map has the same key twice")
        return table

    def count_list(self, items: list[Any]) -> list[Any]:
        self._items += len(items) + 1
        if self._items > MAX_TOTAL:
            raise ValueError(f"it has more than {MAX_TOTAL} items, the limit")
        return items

    def read(self, value: Any, depth: int) -> Any:
        if depth > MAX_DEPTH:
            raise ValueError(f"a message is nested deeper than {MAX_DEPTH}, the limit")
        if isinstance(value, list):
            return [self.read(item, depth + 1) for item in value]
        if not isinstance(value, dict):
            return _checked_leaf(value)
        if b"__ndarray__" in value or b"__npgeneric__" in value:
            return _of_openpi(value)
        if b"nd" in value:
            self.arrays = "msgpack_numpy"
            return _of_msgpack_numpy(value)
        for key in value:
            if not isinstance(key, str):
                raise ValueError(f"a message has the key {key!r:.80}, which is not a text")
        return {key: self.read(item, depth + 1) for key, item in value.items()}


def _checked_leaf(value: Any) -> Any:
    if value is None or isinstance(value, (bool, int, float, str, bytes)):
        return value
    raise ValueError(f"a message has a {type(value).__name__}, which is neither a number, a text, an array, a list nor a map")


def _type_of(array: np.ndarray | np.generic) -> str:
    if array.dtype.str[1:] not in _TYPES:
        raise ValueError(f"an array of type {array.dtype} cannot be sent: only arrays of numbers can")
    return array.dtype.str


def _as_openpi(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": _type_of(value), b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": _type_of(value)}
    raise TypeError(f"a {type(value).__name__} cannot be sent in a message")


def _as_msgpack_numpy(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {b"nd": True, b"type": _type_of(value), b"kind": b"", b"shape": value.shape, b"data": value.tobytes()}
    if isinstance(value, np.generic):
        return {b"nd": False, b"type": _type_of(value), b"data": value.tobytes()}
    raise TypeError(f"a {type(value).__name__} cannot be sent in a message")


def _of_openpi(table: dict[Any, Any]) -> Any:
    if table.keys() == {b"__ndarray__", b"data", b"dtype", b"shape"} and table[b"__ndarray__"] is True:
        return _array(table[b"data"], table[b"dtype"], table[b"shape"])
    if table.keys() == {b"__npgeneric__", b"data", b"dtype"} and isinstance(table[b"data"], (bool, int, float)):
        return _number(table[b"data"], _dtype(table[b"dtype"]))
    raise ValueError("an array of a message does not have the keys of openpi's arrays")


def _of_msgpack_numpy(table: dict[Any, Any]) -> Any:
    if (
        table.keys() - {b"kind"} == {b"nd", b"type", b"shape", b"data"}
        and table[b"nd"] is True
        and table.get(b"kind", b"") == b""
    ):
        return _array(table[b"data"], table[b"type"], table[b"shape"])
    if table.keys() == {b"nd", b"type", b"data"} and table[b"nd"] is False:
        return _array(table[b"data"], table[b"type"], [])[()]
    raise ValueError("an array of a message does not have the keys of msgpack-numpy's numeric arrays")


def _number(value: float, dtype: np.dtype[Any]) -> np.generic:
    number: Any = None
    try:
        with np.errstate(all="ignore"):
            number = np.array(value, dtype)[()]
    except (OverflowError, ValueError):
        pass
    if number is None or (number.item() != value and value == value):
        raise ValueError(f"a number of a message is {value!r:.80}, which does not fit its type {dtype.str}")
    return number


def _dtype(name: Any) -> np.dtype[Any]:
    if not isinstance(name, str) or name[:1] not in ("<", ">", "=", "|") or name[1:] not in _TYPES:
        raise ValueError(f"an array of a message has the type {name!r:.80}: must be a number such as '<f4'")
    return np.dtype(name)


def _array(data: Any, name: Any, shape: Any) -> np.ndarray:
    dtype = _dtype(name)
    is_shape = isinstance(shape, list) and len(shape) <= _MAX_DIMENSIONS
    if not is_shape or not all(type(size) is int and 0 <= size <= MAX_BYTES for size in shape):
        raise ValueError(
            f"an array of a message has the shape {shape!r:.80}: must be at most {_MAX_DIMENSIONS} sizes from 0 to {MAX_BYTES}"
        )
    expected = math.prod(shape) * dtype.itemsize
    if not isinstance(data, bytes) or len(data) != expected:
        found = f"{len(data)} bytes" if isinstance(data, bytes) else f"a {type(data).__name__}"
        raise ValueError(
            f"an array of a message with the shape {shape} and the type {name} has {found} instead of {expected} bytes"
        )
    array = np.ndarray(tuple(shape), dtype, data)
    return array.view(np.uint8) != 0 if dtype.kind == "b" else array  # bytes other than 0 and 1 become True
