# SPDX-License-Identifier: Apache-2.0
"""Arrays as tensors that share their memory, where torch is installed."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import numpy as np

_FOUND = importlib.util.find_spec("torch")
HAS_TORCH = _FOUND is not None and _FOUND.origin is not None  # not a folder that happens to be called so


def tensor(array: np.ndarray | None) -> Any:
    """A torch tensor on the memory of ``array``; the array itself without torch."""
    if array is None or not HAS_TORCH:
        return array
    import torch  # pyright: ignore[reportMissingImports]

    with warnings.catch_warnings():  # it says that ours is read-only: so is mjlab's, by agreement
        warnings.simplefilter("ignore")
        return torch.from_numpy(array)


def ids(env_ids: Any) -> Any:
    """What mjlab takes for some environments (a tensor, a slice, None: all), as the indices or mask that we take."""
    if env_ids is None or (isinstance(env_ids, slice) and env_ids == slice(None)):
        return None
    return env_ids.detach().cpu().numpy() if hasattr(env_ids, "detach") else env_ids  # pyright: ignore


class Cache:
    """One tensor for each array: sensors return the same arrays again and again."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[np.ndarray, Any]] = {}

    def __call__(self, name: str, array: np.ndarray | None) -> Any:
        if array is None:
            return None
        known = self._known.get(name)
        if known is None or known[0] is not array:
            known = self._known[name] = array, tensor(array)
        return known[1]
