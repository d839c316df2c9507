# SPDX-License-Identifier: Apache-2.0
"""Export of recordings to the formats of other programs, one module each. Modules and other programs' libraries are imported when
an export begins."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mjsense.exporting.formats import FORMATS, OPTIONS, Format, Option

if TYPE_CHECKING:
    from mjsense.exporting.functions import (
        export,
        export_lerobot,
        export_lerobot21,
        export_mcap,
        export_rerun,
        export_rlds,
        export_robomimic,
        export_zarr,
    )
    from mjsense.exporting.mapping import Feature, Mapping, Source

__all__ = [
    "FORMATS",
    "OPTIONS",
    "Feature",
    "Format",
    "Mapping",
    "Option",
    "Source",
    "export",
    "export_lerobot",
    "export_lerobot21",
    "export_mcap",
    "export_rerun",
    "export_rlds",
    "export_robomimic",
    "export_zarr",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    module = "mapping" if name in ("Feature", "Mapping", "Source") else "functions"
    return getattr(importlib.import_module(f"{__name__}.{module}"), name)
