# SPDX-License-Identifier: Apache-2.0
"""What the footer of a Parquet file says about its size and compression.

pyarrow 26 ends the process, instead of raising an error, when it returns a column of a damaged footer. Format:
https://github.com/apache/parquet-format, and the compact protocol of Apache Thrift.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

_FOOTER_BYTES = 1 << 26
_MAX_DEPTH = 32
_MAX_VALUES = 2_000_000  # a column of a row group has about 30; reading a million takes a second and 70 MB
# Fields of FileMetaData, RowGroup, ColumnChunk and ColumnMetaData.
_NUM_ROWS, _ROW_GROUPS, _COLUMNS, _TOTAL_BYTE_SIZE, _META_DATA, _CODEC, _NUM_VALUES = 3, 4, 1, 2, 3, 4, 5
_CODECS = ("UNCOMPRESSED", "SNAPPY", "GZIP", "LZO", "BROTLI", "LZ4", "ZSTD", "LZ4_RAW")


@dataclass(frozen=True)
class Footer:
    """The sums over all row groups and columns."""

    rows: int
    values: int
    bytes: int
    """Of the unpacked columns."""
    codecs: frozenset[str]


def read(path: Path, file: BinaryIO) -> Footer:
    """The footer of a file that is open at any position. ``path`` is for errors.

    Raises:
        ValueError: The footer is damaged.
    """
    try:
        size = file.seek(0, 2)
        file.seek(max(0, size - 8))
        length, magic = struct.unpack("<I4s", file.read(8))
        if magic != b"PAR1" or not 0 < length <= min(size - 12, _FOOTER_BYTES):
            raise ValueError
        file.seek(size - 8 - length)
        table = _Reader(file.read(length)).fields(0)
        groups = table[_ROW_GROUPS]
        columns = [column[_META_DATA] for group in groups for column in group[_COLUMNS]]
        values, sizes = [column[_NUM_VALUES] for column in columns], [group[_TOTAL_BYTE_SIZE] for group in groups]
        codecs = {column[_CODEC] for column in columns}
        if min(table[_NUM_ROWS], *values, *sizes, *codecs, 0) < 0:
            raise ValueError
        return Footer(table[_NUM_ROWS], sum(values), sum(sizes), frozenset(_CODECS[codec] for codec in codecs))
    except (ValueError, TypeError, LookupError, struct.error):
        raise ValueError(f"{path}: not a Parquet file that can be read: its footer is damaged") from None


class _Reader:
    """Thrift's compact protocol, without knowledge of the fields."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at, self._values = data, 0, 0

    def _byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def _varint(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise ValueError

    def _number(self) -> int:
        value = self._varint()
        return value >> 1 ^ -(value & 1)

    def _skip(self, size: int) -> None:
        self._at += size
        if self._at > len(self._data):
            raise ValueError

    def fields(self, depth: int) -> dict[int, Any]:
        """A struct: field id -> value; texts and real numbers are left out."""
        found, identifier = {}, 0
        while head := self._byte():
            identifier = identifier + (head >> 4) if head >> 4 else self._number()
            found[identifier] = self._value(head & 15, depth, alone=True)
        return found

    def _value(self, kind: int, depth: int, *, alone: bool = False) -> Any:
        self._values += 1
        if depth > _MAX_DEPTH or self._values > _MAX_VALUES:
            raise ValueError
        if kind in (1, 2):  # a bool: as a field it is in the head, in a list it is a byte
            return kind == 1 if alone else self._byte() == 1
        if kind == 3:
            return self._byte()
        if kind in (4, 5, 6):
            return self._number()
        if kind == 7:
            return self._skip(8)
        if kind == 8:
            return self._skip(self._varint())
        if kind in (9, 10):
            head = self._byte()
            size = self._varint() if head >> 4 == 15 else head >> 4
            return [self._value(head & 15, depth + 1) for _ in range(self._bounded(size))]
        if kind == 11:
            size = self._bounded(self._varint())
            kinds = self._byte() if size else 0
            for _ in range(size):
                self._value(kinds >> 4, depth + 1)
                self._value(kinds & 15, depth + 1)
            return None
        if kind == 12:
            return self.fields(depth + 1)
        raise ValueError

    def _bounded(self, size: int) -> int:
        if size > len(self._data) - self._at:  # every element has at least a byte
            raise ValueError
        return size
