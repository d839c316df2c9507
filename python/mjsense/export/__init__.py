# SPDX-License-Identifier: Apache-2.0
"""Export of recordings to the formats of other programs, one module each. Their libraries are imported when an export begins."""

from mjsense.export.mapping import Feature, Mapping, Source

FORMATS: dict[str, str] = {}
"""Names and one-line descriptions. The module ``mjsense.export.NAME`` has the function ``export_NAME``."""

__all__ = ["FORMATS", "Feature", "Mapping", "Source"]
