# SPDX-License-Identifier: Apache-2.0
"""Arrays of the device as the user sees them: torch tensors on the same memory if torch is installed, otherwise ``wp.array``."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from mjsense.core.arrays import on_host


@cache
def torch() -> Any:
    """The module torch, or None if it is not installed."""
    try:
        import torch  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None
    return torch


def share(array: wp.array) -> Any:
    """The same memory as a tensor, or the array itself without torch."""
    return array if torch() is None else wp.to_torch(array, requires_grad=False)


def tensor(values: Any, dtype: Any, device: Any) -> Any:
    """Values as a tensor. Arrays that must not be written, such as those of a model, are copied: tensors cannot be read-only."""
    if isinstance(values, np.ndarray):
        values = np.require(values, requirements="W")
    return torch().as_tensor(values, dtype=dtype, device=device)


def write(array: wp.array, values: Any, rows: Any = slice(None)) -> None:
    """Writes values, which may broadcast, to these rows. The values of a tensor on the device stay there."""
    if torch() is None:
        host = array.numpy()
        host[rows] = on_host(values)
        array.assign(host)
        return
    target = wp.to_torch(array, requires_grad=False)
    if isinstance(values, wp.array):
        values = wp.to_torch(values, requires_grad=False)
    index = rows if isinstance(rows, slice) else tensor(rows, None, target.device)
    target[index] = tensor(values, target.dtype, target.device)


def device_of(name: str | None) -> Any:
    """The device of this name; by default the first CUDA device, or the CPU without one."""
    if name is None:
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        return wp.get_device(name)
    except Exception:
        known = ", ".join(str(device) for device in wp.get_devices())
        raise ValueError(f"device '{name}': there is no such device; there are {known}") from None
