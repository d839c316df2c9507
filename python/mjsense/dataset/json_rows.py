# SPDX-License-Identifier: Apache-2.0
"""JSON rows as arrays: one per leaf of the rows' tree, with a mask of the rows that have it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mjsense.dataset import bounded_json
from mjsense.dataset.limits import JSON_ROW_BYTES, ROW_LEAVES
from mjsense.dataset.places import is_plain_name, printable


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}/{key}")
    else:
        yield path, value


def _array(values: list[Any]) -> np.ndarray:
    """bool, float64 (null is NaN), or objects for everything else, such as text."""
    if all(isinstance(v, bool) for v in values):
        return np.array(values, bool)
    try:
        array = np.array(values)  # a conversion to float64 would read the text "1" as a number
        if array.dtype.kind in "biuf" or (array.dtype == object and not any(isinstance(v, str) for v in array.flat)):
            return np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError):  # lists of different lengths, or integers that no float64 has
        pass
    array = np.empty(len(values), object)
    array[:] = values
    return array


def _check_leaf(what: str, path: str, number: int) -> None:
    if not all(map(is_plain_name, path[1:].split("/"))):
        raise ValueError(f"{what} has the key '{printable(path[1:101])}', which is not a plain name")
    if number >= ROW_LEAVES:
        raise ValueError(f"{what} has more than {ROW_LEAVES} keys")


def decode(rows: np.ndarray, what: str = "a row") -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """``{"/arm": (values [T, 7], given [T])}`` of uint8 rows ``[T, N]``. Values of rows without the leaf are 0. Lists without
    elements are left out.

    Args:
        what: What has the rows, for errors.

    Raises:
        ValueError: A row is not a JSON object, the name of a leaf is not a plain name, or there are too many leaves.
    """
    columns: dict[str, tuple[list[int], list[Any]]] = {}
    for t, row in enumerate(rows):
        for path, value in _leaves(
            bounded_json.parse_object(row.tobytes().rstrip(b"\0") or b"{}", f"{what} row {t}", JSON_ROW_BYTES), ""
        ):
            if value == []:
                continue
            if path not in columns:
                _check_leaf(f"{what} row {t}", path, len(columns))
            at, values = columns.setdefault(path, ([], []))
            at.append(t)
            values.append(value)
    result = {}
    for path in sorted(columns):
        at, values = columns[path]
        found = _array(values)
        given = np.zeros(len(rows), bool)
        given[at] = True
        if given.all():
            result[path] = found, given
            continue
        array = np.zeros((len(rows), *found.shape[1:]), found.dtype)
        array[at] = found
        if found.dtype == object:
            array[~given] = ""
        result[path] = array, given
    return result
