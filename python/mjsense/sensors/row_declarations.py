# SPDX-License-Identifier: Apache-2.0
"""Declarations of the values of sensors written in Python, and their validation.

A value is an array or a nested dict of arrays. Each array must have the dtype, shape and bounds that its space declares; nothing
is converted implicitly. Only Python numbers and lists of them, which have no dtype, are converted to the declared dtype if it can
represent them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from mjsense.sensors.nested_streams import nest

# dtype in which rows are stored if recordings do not support their own: it can represent every value.
_KEPT = {"int8": "int32", "int16": "int32", "uint32": "int64", "float16": "float32"}
_TYPES = {"float32", "float64", "uint8", "uint16", "int32", "int64", "bool"}


@dataclass
class Row:
    """One array of a world's value."""

    path: tuple[str, ...]
    """Keys that lead to the array; () if it is the value itself."""
    shape: tuple[int, ...]
    dtype: np.dtype
    low: np.ndarray | None = None
    """Bounds, broadcastable to shape; None: unbounded."""
    high: np.ndarray | None = None

    @property
    def name(self) -> str:
        return "/".join(self.path)

    @property
    def kept(self) -> str:
        """Name of the dtype in which rows are stored."""
        name = _KEPT.get(self.dtype.name, self.dtype.name)
        if name not in _TYPES:
            raise ValueError(f"{self._what()}no rows of {self.dtype} can be kept: {', '.join(sorted(_TYPES | set(_KEPT)))} can")
        return name

    def bounds(self) -> tuple[float, float]:
        """Minimum and maximum of the bounds."""
        if self.low is None or self.high is None or not self.low.size:
            return -np.inf, np.inf
        return float(np.min(self.low)), float(np.max(self.high))

    def _what(self) -> str:
        return f"'{self.name}': " if self.path else ""

    def array(self, value: Any, worlds: int | None = None) -> np.ndarray:
        """The value of one world, or of `worlds` worlds, as an array; raises ValueError if it is not as declared."""
        shape = self.shape if worlds is None else (worlds, *self.shape)
        array = np.asarray(value)
        weak = _weak(value)
        if weak and array.ndim == 0 and array.size == int(np.prod(shape)):
            array = array.reshape(shape)
        if array.shape != shape:
            batched = "" if worlds is None else "B worlds, then "
            raise ValueError(f"{self._what()}shape {array.shape} is not {shape}: {batched}the observation_space")
        if array.dtype == self.dtype:
            return array
        if not weak:
            raise ValueError(
                f"{self._what()}{array.dtype} values do not fit the observation_space's {self.dtype}: "
                f"return them as {self.dtype}, or declare {array.dtype}"
            )
        return self._typed(array)

    def _typed(self, array: np.ndarray) -> np.ndarray:
        """Converts Python numbers to the declared dtype."""
        kinds = {"f": "iuf", "i": "biu", "u": "biu", "b": "b"}[self.dtype.kind]
        if array.size and array.dtype.kind not in kinds:
            raise ValueError(f"{self._what()}{array.dtype} values do not fit the observation_space's {self.dtype}")
        if array.size and self.dtype.kind in "iu":
            info = np.iinfo(self.dtype)
            low, high = int(array.min()), int(array.max())
            if low < info.min or high > info.max:
                raise ValueError(
                    f"{self._what()}{low if low < info.min else high} does not fit the observation_space's {self.dtype}"
                )
        return array.astype(self.dtype)

    def outside(self, rows: np.ndarray) -> Iterator[tuple[int, str]]:
        """Yields (index, problem) of the rows ``[n, ...]`` with a value outside the bounds."""
        if self.low is None or self.high is None or not rows.size:
            return
        low, high = np.broadcast_to(self.low, self.shape), np.broadcast_to(self.high, self.shape)
        bad = ~((rows >= low) & (rows <= high))
        if rows.dtype.kind == "f":  # NaN is valid only for unbounded elements
            bad &= ~(np.isnan(rows) & np.isneginf(low) & np.isposinf(high))
        for i in np.flatnonzero(bad.reshape(len(rows), -1).any(1)):
            at = tuple(int(k) for k in np.argwhere(bad[i])[0])
            place = f" at {list(at)}" if at else ""
            yield int(i), f"{self._what()}{rows[i][at]}{place} is outside the observation_space's [{low[at]}, {high[at]}]"


def _weak(value: Any) -> bool:
    """Whether a value consists of Python numbers, which have no dtype."""
    if isinstance(value, (list, tuple)):
        return all(_weak(v) for v in value)
    return isinstance(value, (bool, int, float)) and not isinstance(value, np.generic)


def rows_of_space(space: Any, path: tuple[str, ...] = ()) -> list[Row]:
    """The arrays of a space; empty for a Dict without entries. Raises TypeError for spaces without arrays."""
    spaces = gymnasium.spaces
    if space is None:
        return []
    if isinstance(space, spaces.Dict):
        return [row for key, inner in space.spaces.items() for row in rows_of_space(inner, (*path, str(key)))]
    if isinstance(space, spaces.Discrete):
        first = int(space.start)
        return [Row(path, (), np.dtype(space.dtype), np.array(first), np.array(first + int(space.n) - 1))]
    if isinstance(space, spaces.MultiDiscrete):
        start = np.asarray(getattr(space, "start", 0)) + np.zeros_like(space.nvec)
        return [Row(path, tuple(space.shape), np.dtype(space.dtype), start, start + space.nvec - 1)]
    if isinstance(space, spaces.MultiBinary):
        return [Row(path, tuple(space.shape), np.dtype(space.dtype), np.array(0), np.array(1))]
    shape, dtype = getattr(space, "shape", None), getattr(space, "dtype", None)
    if shape is None or dtype is None:
        raise TypeError(f"observation_space {space} has no rows: Box, Discrete, MultiBinary, MultiDiscrete or Dicts of them have")
    row = Row(path, tuple(shape), np.dtype(dtype))
    if isinstance(space, spaces.Box) and row.dtype.kind != "b":
        info = np.iinfo(row.dtype) if row.dtype.kind in "iu" else None
        minimum, maximum = (info.min, info.max) if info else (-np.inf, np.inf)
        if not (np.all(space.low <= minimum) and np.all(space.high >= maximum)):
            row.low, row.high = space.low, space.high
    return [row]


def rows_of_value(value: Any, path: tuple[str, ...] = ()) -> list[Row]:
    """The arrays of an actual value."""
    if isinstance(value, Mapping):
        return [row for key, inner in value.items() for row in rows_of_value(inner, (*path, str(key)))]
    array = np.asarray(value)
    return [Row(path, array.shape, array.dtype)]


_IMAGE_SIDE = 8  # smallest width and height


def is_image(dtype: Any, shape: Sequence[int]) -> bool:
    """Whether rows are images: uint8 with three axes, or grey images with two."""
    return np.dtype(dtype) == np.uint8 and (len(shape) == 3 or (len(shape) == 2 and min(shape) >= _IMAGE_SIDE))


def is_rgb(dtype: Any, shape: Sequence[int]) -> bool:
    """Whether rows are colour images that a video can store: uint8 ``[H, W, 3]`` or ``[3, H, W]``."""
    sides = () if len(shape) != 3 else shape[:2] if shape[2] == 3 else shape[1:] if shape[0] == 3 else ()
    return np.dtype(dtype) == np.uint8 and len(sides) == 2 and min(sides) >= _IMAGE_SIDE


def leaves(value: Any, rows: list[Row]) -> list[Any]:
    """The parts of a value that belong to the rows; raises ValueError for missing or additional keys."""
    if rows and not rows[0].path:
        return [value]
    flat = dict(_flat(value, ()))
    names = {row.path for row in rows}
    missing = ["/".join(path) for path in names if path not in flat]
    surplus = ["/".join(path) for path in flat if path not in names]
    if missing or surplus:
        raise ValueError(
            "keys are not the observation_space's: "
            + "; ".join(
                f"{word} {', '.join(sorted(some))}" for word, some in (("missing", missing), ("unknown", surplus)) if some
            )
        )
    return [flat[row.path] for row in rows]


def _flat(value: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if not isinstance(value, Mapping):
        yield path, value
        return
    for key, inner in value.items():
        yield from _flat(inner, (*path, str(key)))


def nested(rows: list[Row], values: list[Any]) -> Any:
    """The inverse of leaves(): the array itself, or a nested dict."""
    if rows and not rows[0].path:
        return values[0]
    return nest({row.name: row.path for row in rows}, {row.name: value for row, value in zip(rows, values)})
