# SPDX-License-Identifier: Apache-2.0
"""JSON texts of files, with limits on their size, nesting and number of values."""

from __future__ import annotations

import json
from typing import Any

from mjsense.dataset.limits import JSON_DEPTH, JSON_VALUES


def parse(text: str | bytes, what: str, max_bytes: int, max_values: int = JSON_VALUES, standard: bool = False) -> Any:
    """The value of a JSON text.

    Args:
        what: What has the text, for errors: ``"data/house_0/x.h5: the attribute 'recording'"``.
        standard: Refuse NaN and Infinity, which Python's reader accepts and the JSON of a recording cannot have.
    """

    def refuse(word: str) -> None:
        raise ValueError(f"it has the word {word}")

    if len(text) > max_bytes:
        raise ValueError(f"{what} has {len(text)} bytes, more than {max_bytes}")
    try:
        value = json.loads(text, parse_constant=refuse if standard else None)
    except RecursionError:
        raise ValueError(f"{what} is nested deeper than {JSON_DEPTH} levels") from None
    except ValueError as error:  # also of invalid UTF-8 and numbers of too many digits
        raise ValueError(f"{what} is not JSON text: {error}") from None
    _check_size(value, what, max_values)
    return value


def parse_object(text: str | bytes, what: str, max_bytes: int) -> dict[str, Any]:
    """The same, of an object."""
    value = parse(text, what, max_bytes)
    if not isinstance(value, dict):
        raise ValueError(f"{what} is {kind_of(value)}, not an object")
    return value


def kind_of(value: Any) -> str:
    """JSON's word for the type of a value."""
    kinds = {
        bool: "true or false",
        int: "a number",
        float: "a number",
        str: "a text",
        list: "a list",
        dict: "an object",
        type(None): "null",
    }
    return kinds.get(type(value), type(value).__name__)


def _check_size(value: Any, what: str, max_values: int) -> None:
    count, level = 0, [value]
    for depth in range(JSON_DEPTH + 2):
        inner: list[Any] = []
        for one in level:
            if isinstance(one, dict):
                inner += one.values()
            elif isinstance(one, list):
                inner += one
        count += len(inner)
        if count > max_values:
            raise ValueError(f"{what} has more than {max_values} values")
        if not inner:
            return
        if depth > JSON_DEPTH:
            raise ValueError(f"{what} is nested deeper than {JSON_DEPTH} levels")
        level = inner
