# SPDX-License-Identifier: Apache-2.0
"""Export of recordings to the formats of other programs, one module each. Their libraries are imported when an export begins."""

from mjsense.export.lerobot import export_lerobot
from mjsense.export.lerobot21 import export_lerobot21
from mjsense.export.mapping import Feature, Mapping, Source

FORMATS = {
    "lerobot": "LeRobot v3.0",
    "lerobot21": "LeRobot v2.1 with meta/modality.json, as GR00T reads it",
}
"""Names and one-line descriptions. The module ``mjsense.export.NAME`` has the function ``export_NAME``."""

__all__ = ["FORMATS", "Feature", "Mapping", "Source", "export_lerobot", "export_lerobot21"]
