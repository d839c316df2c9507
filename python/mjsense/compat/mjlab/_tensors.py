# SPDX-License-Identifier: Apache-2.0
"""Converts arrays to torch tensors that share their memory, if torch is installed."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import numpy as np

_FOUND = importlib.util.find_spec("torch")
HAS_TORCH = _FOUND is not None and _FOUND.origin is not None  # None for a mere folder named torch


def tensor(array: Any) -> Any:
    """A torch tensor that shares the memory of ``array``; the array itself if torch is not installed, or if it is on a device."""
    if not isinstance(array, np.ndarray) or not HAS_TORCH:
        return array
    import torch  # pyright: ignore[reportMissingImports]

    with warnings.catch_warnings():  # torch warns that the array is read-only; mjlab's must not be written either
        warnings.simplefilter("ignore")
        return torch.from_numpy(array)


def ids(env_ids: Any) -> Any:
    """Converts mjlab's env_ids (tensor, slice or None) to the indices or mask that mjsense accepts; None means all
    environments."""
    if env_ids is None or (isinstance(env_ids, slice) and env_ids == slice(None)):
        return None
    return env_ids.detach().cpu().numpy() if hasattr(env_ids, "detach") else env_ids  # pyright: ignore


def memory_of(array: Any) -> Any:
    """The object that owns the memory of an array. Sensors return views of the same memory on every read."""
    base = getattr(array, "base", None)
    return array if base is None else base


class Cache:
    """Keeps one tensor for each array."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[Any, Any]] = {}

    def __call__(self, name: str, array: np.ndarray | None) -> Any:
        if array is None:
            return None
        known = self._known.get(name)
        if known is None or known[0] is not memory_of(array):
            known = self._known[name] = memory_of(array), tensor(array)
        return known[1]
