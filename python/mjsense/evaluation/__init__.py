# SPDX-License-Identifier: Apache-2.0
"""Evaluation of policies: fixed episodes of a task are played and recorded, and their results are counted. Modules are imported when they
are used."""

from __future__ import annotations

import importlib
from typing import Any

_PLACES: dict[str, str] = {
    "Comparison": "comparison",
    "Results": "report",
    "compare": "comparison",
    "results": "report",
}
"""Module of each public name."""
__all__ = ["Comparison", "Results", "compare", "results"]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_PLACES[name]}"), name)
