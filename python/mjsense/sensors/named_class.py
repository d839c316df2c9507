# SPDX-License-Identifier: Apache-2.0
"""Sensors of classes that files name."""

from __future__ import annotations

import importlib
from typing import Any


def sensor_of_class(reference: str, arguments: dict[str, Any], context: str) -> Any:
    """An object of the class ``package.module:Class``, made with keyword arguments."""
    module, _, attribute = reference.partition(":")
    try:
        cls: Any = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{context}: class '{reference}' is not found: {error}") from error
    try:
        return cls(**arguments)
    except TypeError as error:
        raise TypeError(f"{context}: class '{reference}' cannot be made: {error}") from error
