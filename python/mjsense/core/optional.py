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
        ImportError: It is installed, but does not work, for example with a newer version of a package that it needs.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{user} needs {module.split('.')[0]}: pip install 'mjsense[{extra}]' ({error})", name=error.name
        ) from error
    except ImportError as error:
        name = module.split(".")[0]
        raise ImportError(
            f"{user} needs {name}, which is installed but cannot be imported: {error}; pip install 'mjsense[{extra}]' "
            "installs versions that work together",
            name=error.name,
        ) from error
