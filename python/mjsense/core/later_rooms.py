# SPDX-License-Identifier: Apache-2.0
"""What earlier rooms use of later ones, which they must not import: functions and classes by a name, imported when they are used.

``mjsense/__init__.py`` says which module has each of them.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

PLACES: dict[str, str] = {}
"""``module:attribute`` by name."""


def provide(places: Mapping[str, str]) -> None:
    """Says where these names are defined: ``module:attribute``."""
    PLACES.update(places)


def provided(name: str) -> Any:
    """The function or class of this name; its module is imported now."""
    module, _, attribute = PLACES[name].partition(":")
    return getattr(importlib.import_module(module), attribute)
