# SPDX-License-Identifier: Apache-2.0
"""Optional dependencies."""

from __future__ import annotations

import importlib
from typing import Any


def optional(module: str, extra: str, user: str) -> Any:
    """A module of an optional dependency.

    Args:
        extra: Extra of mjsense that installs it.
        user: What needs it: the subject of the message.

    Raises:
        ModuleNotFoundError: It is not installed; the message names the extra.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{user} needs {module.split('.')[0]}: pip install 'mjsense[{extra}]' ({error})", name=error.name
        ) from error
