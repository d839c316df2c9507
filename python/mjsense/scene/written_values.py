# SPDX-License-Identifier: Apache-2.0
"""Values that are written to components of the state or to fields of the model."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbers(name: str, value: Any) -> np.ndarray:
    """The value as a float64 array; raises ValueError, with the component's name, unless it consists of numbers."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.empty(1, object)
    if array.size and array.dtype.kind not in "biuf":
        raise ValueError(f"{name}: values must be numbers, not {value!r:.100}")
    return array.astype(np.float64, copy=False)


def write_component(name: str, target: np.ndarray, value: Any) -> None:
    """Writes values, which may broadcast, to a component of the state."""
    array = numbers(name, value)
    try:
        target[...] = array
    except ValueError:
        raise ValueError(f"{name}: shape {array.shape} does not broadcast to {target.shape}") from None
