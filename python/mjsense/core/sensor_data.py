# SPDX-License-Identifier: Apache-2.0
"""Base class of the measurements of sensors with several fields (sensors/data.py)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean


@dataclass(slots=True, frozen=True)
class SensorData:
    """Base class; used directly for sensors of other kinds."""

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{f.name}={getattr(self, f.name).dtype}{list(getattr(self, f.name).shape)}"
            for f in fields(self)
            if getattr(self, f.name) is not None
        )
        return f"{type(self).__name__}({shown})"

    def __getattr__(self, name: str) -> Any:  # a name without a field
        hint = "" if name[0] == "_" else did_you_mean(name, [f.name for f in fields(self)], "there are")
        raise AttributeError(f"{type(self).__name__} has no attribute '{name}'{hint}")


def make_data(base: type, arrays: dict[str, np.ndarray]) -> Any:
    """An instance of `base` with these fields; fields that it does not declare are added in a subclass."""
    known = {f.name for f in fields(base)}
    extra = [name for name in arrays if name not in known]
    if extra:
        namespace = {"__annotations__": dict.fromkeys(extra, "np.ndarray | None"), **dict.fromkeys(extra)}
        base = dataclass(repr=False, frozen=True)(type(base.__name__, (base,), namespace))
    return base(**arrays)
