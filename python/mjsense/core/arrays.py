# SPDX-License-Identifier: Apache-2.0
"""NumPy arrays of tensors and other arrays, wherever their memory is, and ids of worlds."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.sensor_data import SensorData


def on_host(values: Any) -> np.ndarray:
    """Numbers, an array, a tensor or a ``wp.array`` as a NumPy array."""
    values = values.detach().cpu() if hasattr(values, "detach") else values
    return values.numpy() if hasattr(values, "numpy") else np.asarray(values)


def copied(array: Any) -> Any:
    """A copy of an array, or of a tensor on its device; a ``wp.array`` becomes a NumPy array."""
    return array.clone() if hasattr(array, "clone") else np.array(on_host(array))


def fresh(value: Any) -> Any:
    """The same memory in new array objects: a shape, dtype or strides that one reader sets do not reach the others.

    Args:
        value: An array, a dict of arrays, also nested, or the data of a sensor. Other values are returned as they are.
    """
    if isinstance(value, np.ndarray):
        return value.view()
    if isinstance(value, dict):
        return {name: fresh(part) for name, part in value.items()}
    if not isinstance(value, SensorData):
        return value
    made = object.__new__(type(value))  # dataclasses.replace() takes twice as long
    for name in value.__dataclass_fields__:
        array = getattr(value, name)
        object.__setattr__(made, name, array.view() if isinstance(array, np.ndarray) else array)
    return made


def ids_of_worlds(given: Any, count: int) -> np.ndarray:
    """Ids of worlds, int64 ``[n]``.

    Args:
        given: Ids, or a mask, bool ``[count]``.
        count: Number of worlds.

    Raises:
        TypeError: Neither ids nor a mask.
        ValueError: A mask of another shape, or an id that is not in [0, count).
    """
    ids = on_host(given)
    if ids.dtype == bool:
        if ids.shape != (count,):
            raise ValueError(f"world_ids: a mask of shape {ids.shape} for {counted(count, 'world')}")
        return np.flatnonzero(ids)
    if ids.size and not np.issubdtype(ids.dtype, np.integer):
        raise TypeError(f"world_ids must be integers or a mask, not {given!r}")
    ids = ids.reshape(-1)
    if len(wrong := ids[(ids < 0) | (ids >= count)]):
        raise ValueError(f"world id {wrong[0]}: must be in [0, {count})")
    return ids.astype(np.int64)
