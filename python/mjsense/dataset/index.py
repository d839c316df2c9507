# SPDX-License-Identifier: Apache-2.0
"""``index.parquet``, which is not trusted: its columns, types and paths are checked."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mjsense.core.optional import optional
from mjsense.dataset import parquet_footer
from mjsense.dataset.limits import EPISODES, STEPS, TEXT_BYTES
from mjsense.dataset.places import open_plain, printable

PATH = re.compile(r"(shard_[0-9]{1,9}/)?house_[0-9]{1,9}/trajectories_batch_[0-9]{1,9}_of_[0-9]{1,9}\.h5")
"""Paths of HDF5 files, relative to the index."""
_TRAJECTORY = re.compile(r"traj_(0|[1-9][0-9]{0,8})")
_TEXTS = {"path": 256, "trajectory": 32, "outcome": TEXT_BYTES, "task": TEXT_BYTES}
"""Columns of texts, and how long they may be."""
_NUMBERS = {"episode": (0, 2**53), "length": (0, STEPS), "seed": (0, 2**64 - 1)}
"""Columns of whole numbers, and their bounds."""
_PACKED = ("UNCOMPRESSED", "SNAPPY")  # others can have a ratio of thousands
_TABLE_BYTES = 1 << 30
_ROWS = 4096  # at a time
_BATCH_BYTES = 1 << 28  # of the texts of so many rows


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The rows of an index: ``episode``, ``path``, ``trajectory``, ``seed``, ``length``, ``success``, ``outcome`` and ``task``.

    Raises:
        ValueError: The file is damaged, or a value is out of bounds.
    """
    parquet, arrow = (optional(module, "ray", f"Reading {path}") for module in ("pyarrow.parquet", "pyarrow"))
    rows: list[dict[str, Any]] = []
    with open_plain(path) as plain:
        try:
            footer = parquet_footer.read(path, plain)
            if footer.rows > EPISODES:
                raise ValueError(f"{path} has {footer.rows} rows, more than {EPISODES}")
            if footer.bytes > _TABLE_BYTES:
                raise ValueError(f"{path} has {footer.bytes} bytes when it is unpacked, more than {_TABLE_BYTES}")
            if other := footer.codecs - set(_PACKED):
                raise ValueError(f"{path} is packed with {min(other)}; it must be {' or '.join(_PACKED)}")
            plain.seek(0)
            _check_columns(path, parquet.ParquetFile(arrow.PythonFile(plain, "r")).schema_arrow)
            # Dictionaries of texts: a text that occurs in many rows is not copied for each of them.
            file = parquet.ParquetFile(arrow.PythonFile(plain, "r"), read_dictionary=list(_TEXTS))
            for batch in file.iter_batches(_ROWS, columns=[*_TEXTS, *_NUMBERS, "success"]):
                _check_texts(path, batch)
                rows += [checked_row(path, len(rows) + i, row) for i, row in enumerate(batch.to_pylist())]
        except (arrow.ArrowException, OSError, UnicodeDecodeError) as error:
            raise ValueError(f"{path}: not an index that can be read: {printable(str(error)[:200])}") from None
    return rows


def _check_columns(path: Path, schema: Any) -> None:
    # Lists have a value_type too.
    types = {field.name: str(field.type.value_type if hasattr(field.type, "index_type") else field.type) for field in schema}
    expected = {**dict.fromkeys(_TEXTS, ("string",)), **dict.fromkeys(_NUMBERS, ("int64", "uint64")), "success": ("bool",)}
    for name, kinds in expected.items():
        if types.get(name) not in kinds:
            raise ValueError(
                f"{path}: the column '{name}' is {printable(types.get(name, 'missing')[:100])}; it must be {' or '.join(kinds)}"
            )


def _check_texts(path: Path, batch: Any) -> None:
    """The number of bytes that the rows need as Python objects."""
    total = 0
    for name, most in _TEXTS.items():
        column = batch.column(name)
        words = column.dictionary if hasattr(column, "dictionary") else column
        longest = max((len(word.as_py() or "") for word in words), default=0) if words.nbytes < _BATCH_BYTES else most + 1
        if longest > most:
            raise ValueError(f"{path}: the column '{name}' has a text of more than {most} characters")
        total += longest * len(batch)
    if total > _BATCH_BYTES:
        raise ValueError(f"{path}: the texts of {len(batch)} rows have up to {total} characters, more than {_BATCH_BYTES}")


def checked_row(path: Path | str, number: int, row: Any) -> dict[str, Any]:
    """The row of an index, or of a shard's results, with values in their bounds."""
    what = f"{path} row {number}"
    if not isinstance(row, dict) or row.keys() != {*_TEXTS, *_NUMBERS, "success"}:
        raise ValueError(f"{what} must have exactly the columns {', '.join([*_TEXTS, *_NUMBERS, 'success'])}")
    for name, (low, high) in _NUMBERS.items():
        value = row[name]
        if not ((isinstance(value, int) and low <= value <= high) or (value is None and name == "seed")):
            raise ValueError(f"{what}: {name} is {value}; it must be a whole number from {low} to {high}")
    for name, pattern in (("path", PATH), ("trajectory", _TRAJECTORY)):
        if not isinstance(row[name], str) or not pattern.fullmatch(row[name]):
            shown = "house_0/trajectories_batch_1_of_1.h5, with or without a shard in front" if name == "path" else "traj_0"
            raise ValueError(f"{what}: {name} is '{printable(str(row[name])[:100])}'; it must have the form {shown}")
    for name in ("outcome", "task"):
        if not isinstance(row[name], (str, type(None))):
            raise ValueError(f"{what}: {name} is not a text")
        row[name] = row[name] or ""
    return row
