# SPDX-License-Identifier: Apache-2.0
"""Matches names with regular expressions as mjlab does: anchored at the first character; the first matching expression counts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mjsense.core.errors import UnknownNameError


def matching(expressions: str | Iterable[str], names: Sequence[str]) -> list[str]:
    """Names that an expression matches from their beginning."""
    compiled = [re.compile(e) for e in ((expressions,) if isinstance(expressions, str) else expressions)]
    return [name for name in names if any(e.match(name) for e in compiled)]


def value_of(field: Any, name: str, default: Any = None) -> Any:
    """The value of a field for `name`: the field itself, or, of a mapping, the value of the first expression that matches."""
    if not isinstance(field, Mapping):
        return field
    return next((value for expression, value in field.items() if re.match(expression, name)), default)


def find(keys: str | Sequence[str], names: Sequence[str], what: str, preserve_order: bool = False) -> tuple[list[int], list[str]]:
    """Indices and names that the keys match completely, in model order or in the keys' order.

    Raises UnknownNameError for a key without a match.
    """
    keys = [keys] if isinstance(keys, str) else list(keys)
    hits = {key: [i for i, name in enumerate(names) if re.fullmatch(key, name)] for key in keys}
    for key, found in hits.items():
        if not found:
            raise UnknownNameError(f"no {what} matches '{key}'; there are {', '.join(names) or 'none'}")
    indices = [i for key in keys for i in hits[key]] if preserve_order else sorted({i for found in hits.values() for i in found})
    return indices, [names[i] for i in indices]
