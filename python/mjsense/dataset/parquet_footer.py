# SPDX-License-Identifier: Apache-2.0
"""What a Parquet file says about its size and compression, in its footer and in the headers of its pages.

pyarrow 26 ends the process, instead of raising an error, when it returns a column of a damaged footer, and unpacks a page to the
size in its header, which can be another than that in the footer. Format: https://github.com/apache/parquet-format, and the
compact protocol of Apache Thrift.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

_FOOTER_BYTES = 1 << 26
_MAX_DEPTH = 32
_MAX_VALUES = 2_000_000  # a column of a row group has about 30; reading a million takes a second and 70 MB
_HEADER_BYTES = (1 << 10, 1 << 16)  # usual and most bytes of a page's header
_MAX_HEADERS = 1 << 22  # of all of them; a header has about 40
# Fields of FileMetaData, RowGroup, ColumnChunk, ColumnMetaData and PageHeader.
_NUM_ROWS, _ROW_GROUPS, _COLUMNS, _META_DATA, _CODEC, _NUM_VALUES = 3, 4, 1, 3, 4, 5
_PACKED, _DATA_PAGE, _DICTIONARY_PAGE = 7, 9, 11
_PAGE_UNPACKED, _PAGE_PACKED = 2, 3
_CODECS = ("UNCOMPRESSED", "SNAPPY", "GZIP", "LZO", "BROTLI", "LZ4", "ZSTD", "LZ4_RAW")


@dataclass(frozen=True)
class Footer:
    """The sums over all row groups and columns."""

    rows: int
    values: int
    bytes: int
    """Of the unpacked pages. The footer's own sizes may be others."""
    codecs: frozenset[str]


def read(path: Path, file: BinaryIO) -> Footer:
    """The footer of a file that is open at any position, and the sizes of its pages. ``path`` is for errors.

    Raises:
        ValueError: The footer or the header of a page is damaged.
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
        rows, values = table[_NUM_ROWS], [column[_NUM_VALUES] for column in columns]
        codecs = {column[_CODEC] for column in columns}
        places = [(min(column[_DATA_PAGE], column.get(_DICTIONARY_PAGE) or size), column[_PACKED]) for column in columns]
        if min(rows, *values, *codecs, 0) < 0 or any(min(place) < 0 or sum(place) > size for place in places):
            raise ValueError
        names = frozenset(_CODECS[codec] for codec in codecs)
    except (ValueError, TypeError, LookupError, struct.error):
        raise ValueError(f"{path}: not a Parquet file that can be read: its footer is damaged") from None
    unpacked = parsed = 0
    for begin, packed in places:
        for page in _pages(path, file, begin, begin + packed):
            unpacked += page.unpacked
            parsed += page.header
            if parsed > _MAX_HEADERS:
                raise ValueError(f"{path}: the headers of its pages have more than {_MAX_HEADERS} bytes")
    return Footer(rows, sum(values), unpacked, names)


class _Page(NamedTuple):
    header: int
    """Bytes of the header."""
    packed: int
    unpacked: int


def _pages(path: Path, file: BinaryIO, at: int, end: int) -> Iterator[_Page]:
    """The pages of a column between two places of the file."""
    while at < end:
        page = next(filter(None, (_page(file, at, min(most, end - at)) for most in _HEADER_BYTES)), None)
        if page is None or min(page.packed, page.unpacked) < 0 or page.header + page.packed > end - at:
            raise ValueError(f"{path}: not a Parquet file that can be read: the header of a page is damaged")
        yield page
        at += page.header + page.packed


def _page(file: BinaryIO, at: int, most: int) -> _Page | None:
    """None if the header is damaged or has more bytes."""
    file.seek(at)
    reader = _Reader(file.read(most))
    try:
        header = reader.fields(0)
        return _Page(reader.at, int(header[_PAGE_PACKED]), int(header[_PAGE_UNPACKED]))
    except (ValueError, TypeError, LookupError):
        return None


class _Reader:
    """Thrift's compact protocol, without knowledge of the fields."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at, self._values = data, 0, 0

    @property
    def at(self) -> int:
        """Number of bytes that have been read."""
        return self._at

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
