# SPDX-License-Identifier: Apache-2.0
"""Datasets of HDF5 files.

The type, shape and size are checked before anything is read. Chunks are unpacked here, because the HDF5 library reads beyond the
end of one that is shorter than its shape says. A dataset that is read as a whole is compared with its checksum.
"""

from __future__ import annotations

import itertools
import zlib
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.counted import counted
from mjsense.core.optional import optional
from mjsense.dataset import limits
from mjsense.dataset.hdf5_values import Attributes, reading, string_class, text_of
from mjsense.dataset.places import printable

_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000
_FILTERS = (_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF)
_SUM_BYTES = 4  # fletcher32's sum follows the data
_FREE_BYTES = 1 << 26  # a dataset of at most so many bytes may store none


class Rows:
    """A dataset. Its storage, type and shape are checked when it is opened."""

    def __init__(self, dataset: Any, file: str, file_bytes: int, place: str) -> None:
        self._dataset, self._file_bytes = dataset, file_bytes
        self.where = f"{file} {place}"
        with reading(self.where):
            if dataset.shape is None:
                raise ValueError("is empty: it has neither a value nor rows")
            self.dtype: np.dtype[Any] = dataset.dtype
            self.shape: tuple[int, ...] = dataset.shape
            self._check_storage()
        self.attrs = Attributes(dataset, self.where)

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def is_number(self) -> bool:
        """Whether it contains numbers or bools of a type that NumPy has."""
        return self.dtype.kind in "biuf" and self.dtype.itemsize <= 8

    def __len__(self) -> int:
        if not self.shape:
            raise ValueError(f"{self.where} has no rows: it is a single value")
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        """All of it for ``[:]``, ``[...]`` and ``[()]``, or one or several rows."""
        if isinstance(key, (int, np.integer)):
            if not -len(self) <= key < len(self):
                raise IndexError(f"{self.where} has {counted(len(self), 'row')}, not {key}")
            return self._read(int(key) % len(self), 1)[0]
        if key is Ellipsis or key == () or key == slice(None):
            return self.read()
        if isinstance(key, slice) and key.step is None:
            begin, end, _ = key.indices(len(self))
            return self._read(begin, max(0, end - begin))
        raise TypeError(f"{self.where}: a row or all of it can be read, not {key!r}")

    def read(self) -> Any:
        """All of it, after its checksum has been compared: an array, or the bytes of a text."""
        if not self.is_number:
            return self._text()
        self.check_whole()
        values = self._read(0, self.shape[0] if self.shape else 1)
        self._compare(values)
        return values if self.shape else values.reshape(())[()]

    def text(self) -> str:
        """A text, or the bytes of one without the zeros at its end."""
        if self.is_number and self.dtype != np.uint8:
            raise ValueError(f"{self.where} is of the type {self.dtype}; it must be a text")
        return text_of(self.read())

    def check_whole(self) -> None:
        """Raises an error if there is too much to read at once."""
        most = limits.UNPACKED_FREE + limits.UNPACKED_RATIO * self._file_bytes
        if self.bytes > most:
            raise ValueError(
                f"{self.where} has {self.bytes} bytes, more than the {most} that are read from a file of {self._file_bytes} bytes"
            )

    @property
    def has_chunk_checksums(self) -> bool:
        """Whether each chunk has a checksum of its own (zlib's), so that reading some rows notices damage."""
        return _DEFLATE in self._filters

    def compare(self) -> None:
        """Compares all rows with their checksum, in parts."""
        if not (stated := self.attrs.text("crc32")):
            return
        step = max(1, limits.ROW_BYTES // max(1, self.bytes // max(1, len(self))))
        found = 0
        for first in range(0, len(self), step):
            rows: Any = self._read(first, min(step, len(self) - first))
            found = zlib.crc32(rows, found)
        self._check_sum(found, stated)

    def rows_of(self, length: int) -> Rows:
        """This dataset, if it has so many rows."""
        if not self.shape or self.shape[0] != length:
            raise ValueError(
                f"{self.where} has {counted(self.shape[0] if self.shape else 0, 'row')}; its episode has "
                f"{counted(length, 'observation')}"
            )
        return self

    def _text(self) -> bytes:
        if self.shape or self._dataset.id.get_type().get_class() != string_class():
            raise ValueError(f"{self.where} is of the type {self.dtype}; it must be numbers or one text")
        if self.dtype.itemsize > limits.SCENE_BYTES:
            raise ValueError(f"{self.where} has {self.dtype.itemsize} bytes, more than {limits.SCENE_BYTES}")
        with reading(self.where):
            found = self._dataset[()]
        text = found.encode() if isinstance(found, str) else bytes(found)
        if len(text) > limits.SCENE_BYTES:
            raise ValueError(f"{self.where} has {len(text)} bytes, more than {limits.SCENE_BYTES}")
        self._compare(text)
        return text

    def _compare(self, values: Any) -> None:
        if stated := self.attrs.text("crc32"):
            self._check_sum(zlib.crc32(values), stated)

    def _check_sum(self, found: int, stated: str) -> None:
        if f"{found:08x}" != stated:
            raise ValueError(
                f"{self.where} differs from what was recorded: its checksum is not {printable(stated[:20])}; "
                "`mjsense verify` lists what is damaged"
            )

    def _check_storage(self) -> None:
        h5d = optional("h5py.h5d", "dataset", "Reading recordings")
        properties = self._dataset.id.get_create_plist()
        layout = properties.get_layout()
        if properties.get_external_count():
            raise ValueError("is stored in other files, which are not read")
        if layout not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED):
            raise ValueError("is a virtual dataset, which is not read")
        self._chunk: tuple[int, ...] | None = None
        self._filters: list[int] = []
        row = _product(self.shape[1:]) * self.dtype.itemsize
        if row > limits.ROW_BYTES:
            raise ValueError(f"has rows of {row} bytes, more than {limits.ROW_BYTES}")
        self.bytes = _product(self.shape) * self.dtype.itemsize
        if self.shape and self.shape[0] > limits.STEPS:
            raise ValueError(f"has {counted(self.shape[0], 'row')}, more than {limits.STEPS}")
        if layout == h5d.CHUNKED:
            self._chunk = tuple(properties.get_chunk())
            self._filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
            if unknown := [f for f in self._filters if f not in _FILTERS]:
                raise ValueError(f"is packed with the filter {unknown[0]}; gzip and lzf can be read")
            if (bytes_ := _product(self._chunk) * self.dtype.itemsize) > limits.ROW_BYTES:
                raise ValueError(f"has chunks of {bytes_} bytes, more than {limits.ROW_BYTES}")
        if self.bytes > _FREE_BYTES:
            stored = self._dataset.id.get_storage_size()
            if self.bytes - _FREE_BYTES > limits.RATIO * stored:
                raise ValueError(f"declares {self.bytes} bytes but stores {stored}")

    def _read(self, first: int, count: int) -> np.ndarray:
        """Rows ``first`` to ``first + count - 1``."""
        with reading(self.where):
            h5t = optional("h5py.h5t", "dataset", "Reading recordings")
            if not self.is_number or not self._dataset.id.get_type().equal(h5t.py_create(self.dtype, logical=True)):
                raise ValueError(f"is of the type {self.dtype}, in a form that is never recorded; it must be numbers")
            if self._chunk is None:
                found = self._dataset[first : first + count] if self.shape else np.asarray(self._dataset[()]).reshape(1)
                return found
            return self._read_chunks(first, count)

    def _read_chunks(self, first: int, count: int) -> np.ndarray:
        assert self._chunk is not None
        chunk, shape = self._chunk, self.shape
        begins = [
            range(first - first % chunk[0], first + count, chunk[0]),
            *(range(0, size, step) for size, step in zip(shape[1:], chunk[1:])),
        ]
        if (number := _product(tuple(len(begin) for begin in begins))) > limits.CHUNKS:
            raise ValueError(f"has {number} chunks, more than {limits.CHUNKS}")
        result = np.full((count, *shape[1:]), self._dataset.fillvalue, self.dtype)
        for at in itertools.product(*begins):
            values = self._unpacked(at)
            if values is None:
                continue
            inside = tuple(slice(0, min(step, size - begin)) for step, size, begin in zip(chunk, shape, at))
            skip, end = max(first - at[0], 0), min(first + count - at[0], inside[0].stop)
            target = (
                slice(at[0] + skip - first, at[0] + end - first),
                *(slice(b, b + i.stop) for b, i in zip(at[1:], inside[1:])),
            )
            result[target] = values[(slice(skip, end), *inside[1:])]
        return result

    def _unpacked(self, at: tuple[int, ...]) -> np.ndarray | None:
        """A chunk, by the place of its first element; None: it is not stored."""
        assert self._chunk is not None
        dataset, size = self._dataset.id, _product(self._chunk) * self.dtype.itemsize
        stored = dataset.get_chunk_info_by_coord(at).size
        if not stored:
            return None
        if stored > limits.ROW_BYTES + (limits.ROW_BYTES >> 4):
            raise ValueError(f"has a packed chunk of {stored} bytes, more than {limits.ROW_BYTES}")
        # Without filters, h5py 3.16 allocates a whole chunk, and HDF5 writes into it as many bytes as are stored.
        if not self._filters and stored != size:
            raise ValueError(f"is damaged: one of its chunks has {counted(stored, 'byte')}, expected {size}")
        without, data = dataset.read_direct_chunk(at)
        for i in reversed(range(len(self._filters))):
            if without >> i & 1:
                continue
            data = _without_filter(self._filters[i], data, size + _SUM_BYTES * len(self._filters), self.dtype.itemsize)
        if len(data) != size:
            raise ValueError(f"is damaged: one of its chunks does not unpack to {size} bytes")
        if self.dtype == bool:
            return (np.frombuffer(data, np.uint8) != 0).reshape(self._chunk)
        return np.frombuffer(data, self.dtype).reshape(self._chunk)


def _without_filter(filter: int, data: Any, most: int, item: int) -> Any:
    """The bytes before a filter was applied; none if the data are damaged."""
    if filter == _DEFLATE:
        unpacker = zlib.decompressobj()
        try:
            data = unpacker.decompress(data, most)
        except zlib.error:
            return b""
        return data if unpacker.eof else b""
    if filter == _LZF:
        return _core.lzf_unpack(bytes(data), most)
    if filter == _SHUFFLE:
        whole = len(data) - len(data) % item
        return np.frombuffer(data, np.uint8, whole).reshape(item, -1).T.tobytes() + bytes(data[whole:])
    return data[: max(0, len(data) - _SUM_BYTES)]


def _product(numbers: tuple[int, ...]) -> int:
    result = 1
    for number in numbers:
        result *= number
    return result
