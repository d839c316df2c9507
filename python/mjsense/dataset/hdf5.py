# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of recordings, which are not trusted: every object and value passes the checks of this module.

Only hard links are followed, so nothing outside of the file is read. The type, shape and size of a dataset are checked before it
is read. Chunks are unpacked here, because the HDF5 library reads beyond the end of one that is shorter than its shape says. A
dataset that is read as a whole is compared with its checksum.
"""

from __future__ import annotations

import contextlib
import itertools
import threading
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import unreadable
from mjsense.core.optional import optional
from mjsense.dataset import limits
from mjsense.dataset.places import is_plain_name, open_plain, printable

_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000
_FILTERS = (_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF)
_SUM_BYTES = 4  # fletcher32's sum follows the data
_FREE_BYTES = 1 << 26  # a dataset of at most so many bytes may store none
_ERRORS = (KeyError, OSError, RuntimeError, ValueError, TypeError, OverflowError, MemoryError)


def text_of(value: Any) -> str:
    """A text attribute or a text dataset's value; a row of bytes ends at the first 0."""
    if isinstance(value, str):
        return value
    return bytes(value).split(b"\0", 1)[0].decode(errors="replace")


class _Kept(threading.local):
    """The file that this thread keeps open."""

    path: Path | None = None
    root: Group | None = None


_kept = _Kept()


@contextlib.contextmanager
def kept_open(path: Path) -> Iterator[None]:
    """Inside of the block, this thread opens the file once for all calls of :func:`open_h5`. Blocks cannot be nested."""
    with open_h5(path) as _kept.root:
        _kept.path = path
        try:
            yield
        finally:
            _kept.path = _kept.root = None


@contextlib.contextmanager
def open_h5(path: Path) -> Iterator[Group]:
    """The root group of a file, which is open inside of the block."""
    if _kept.root is not None and _kept.path == path:
        yield _kept.root
        return
    h5py = optional("h5py", "dataset", "Reading recordings")
    with open_plain(path) as plain:
        try:
            file = h5py.File(f"/proc/self/fd/{plain.fileno()}", "r")
        except OSError as error:
            raise unreadable(path, error, "an HDF5 file") from None
        with file:
            yield Group(file, str(path), plain.size)


class Attributes:
    """Attributes of an object: texts, numbers, and small arrays of numbers."""

    def __init__(self, owner: Any, place: str) -> None:
        self._owner, self._place = owner, place

    def __contains__(self, name: str) -> bool:
        return name in self._owner.attrs

    def get(self, name: str, default: Any = None) -> Any:
        """The value, or the default if there is no such attribute."""
        attributes = self._owner.attrs
        if name not in attributes:
            return default
        what = f"{self._place}: the attribute '{name}'"
        with _reading(what):
            about = attributes.get_id(name)
            size = int(np.prod(about.shape or (), dtype=np.float64)) * about.dtype.itemsize
            if about.dtype.kind not in "biufSO" or size > limits.DESCRIPTION_BYTES:
                raise ValueError(f"is of an unknown type or has more than {limits.DESCRIPTION_BYTES} bytes")
            if about.dtype.kind == "O" and (about.shape or about.get_type().get_class() != _string_class()):
                raise ValueError("is neither a text nor numbers")
            value = attributes[name]
            if isinstance(value, (str, bytes)) and len(value) > limits.DESCRIPTION_BYTES:
                raise ValueError(f"has {len(value)} bytes, more than {limits.DESCRIPTION_BYTES}")
        return value

    def __getitem__(self, name: str) -> Any:
        if (value := self.get(name)) is None:
            raise UnknownNameError(f"{self._place} has no attribute '{name}'")
        return value

    def text(self, name: str, default: str = "", most: int = limits.TEXT_BYTES) -> str:
        """A text of at most so many bytes."""
        value = self.get(name)
        if value is None:
            return default
        if not isinstance(value, (str, bytes)):
            raise ValueError(f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}, not a text")
        if len(value) > most:
            raise ValueError(f"{self._place}: the attribute '{name}' has {len(value)} bytes, more than {most}")
        return text_of(value)

    def integer(self, name: str, low: int, high: int) -> int | None:
        """A whole number in these bounds; None if there is no such attribute."""
        value = self.get(name)
        if value is None:
            return None
        if not isinstance(value, np.integer) or not low <= int(value) <= high:
            raise ValueError(
                f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}; it must be a whole number "
                f"from {low} to {high}"
            )
        return int(value)

    def number(self, name: str, default: float) -> float:
        """A finite number that is not negative."""
        value = self.get(name, default)
        if not isinstance(value, (float, np.floating, np.integer)) or not 0 <= float(value) < np.inf:
            raise ValueError(
                f"{self._place}: the attribute '{name}' is {printable(repr(value)[:50])}; it must be a finite "
                "number of at least 0"
            )
        return float(value)


class Group:
    """A group of a file."""

    def __init__(self, group: Any, file: str, file_bytes: int, place: str = "") -> None:
        self._group, self._file, self._file_bytes, self._place = group, file, file_bytes, place
        self.attrs = Attributes(group, self.where)

    @property
    def name(self) -> str:
        """Path in the file, from its root: ``/traj_0/obs``."""
        return f"/{self._place}"

    @property
    def where(self) -> str:
        """File and place, for messages."""
        return f"{self._file} {self._place}".rstrip()

    def __contains__(self, path: str) -> bool:
        return self._links(path) is None

    def __getitem__(self, path: str) -> Any:
        where = f"{self._file} {self._below(path)}"
        if wrong := self._links(path):
            raise (UnknownNameError if wrong == "does not exist" else ValueError)(f"{where} {wrong}")
        with _reading(where):
            found = self._group[path]
        if hasattr(found, "dtype") and hasattr(found, "shape"):
            return Rows(found, self._file, self._file_bytes, self._below(path))
        if not hasattr(found, "keys"):
            raise ValueError(f"{where} is neither a group nor a dataset")
        return Group(found, self._file, self._file_bytes, self._below(path))

    def get(self, path: str, default: Any = None) -> Any:
        """The group or dataset, or the default if there is none."""
        return default if self._links(path) == "does not exist" else self[path]

    def names(self) -> list[str]:
        """Names of the group's members."""
        if len(self._group) > limits.NAMES:
            raise ValueError(f"{self.where} has {len(self._group)} members, more than {limits.NAMES}")
        with _reading(self.where):
            names = list(self._group)
        for name in names:
            if not is_plain_name(name):
                raise ValueError(f"{self.where} has a member named '{printable(name[:100])}', which is not a plain name")
        return names

    __iter__ = lambda self: iter(self.names())  # noqa: E731

    def items(self) -> Iterator[tuple[str, Any]]:
        """Names and members."""
        return ((name, self[name]) for name in self.names())

    def datasets(self) -> list[str]:
        """Paths of all members of all levels that hard links reach."""
        found: list[str] = []
        wrong: list[str] = []

        def visit(path: str) -> bool | None:
            if len(found) >= limits.NAMES:
                wrong.append(f"has more than {limits.NAMES} members")
            elif path.count("/") >= limits.GROUP_DEPTH:
                wrong.append(f"is nested deeper than {limits.GROUP_DEPTH} groups")
            elif not all(map(is_plain_name, path.split("/"))):
                wrong.append(f"has a member named '{printable(path[:100])}', which is not a plain name")
            found.append(path)
            return True if wrong else None

        with _reading(self.where):
            self._group.visit(visit)
        if wrong:
            raise ValueError(f"{self.where} {wrong[0]}")
        return found

    def _below(self, path: str) -> str:
        return f"{self._place}/{path}" if self._place else path

    def _links(self, path: str) -> str | None:
        """The fault of a path: one of its links does not exist, or is not a hard link. None: it has none."""
        parts = path.split("/")
        if len(parts) > limits.GROUP_DEPTH or not all(parts) or "." in parts:
            return "does not exist"
        h5l = optional("h5py.h5l", "dataset", "Reading recordings")
        links, group = self._group.id.links, b""
        for part in parts:
            group += part.encode(errors="surrogateescape")
            try:
                if not links.exists(group):
                    return "does not exist"
                kind = links.get_info(group).type
            except _ERRORS:
                return "does not exist"
            if kind != h5l.TYPE_HARD:
                return f"is {'an external' if kind == h5l.TYPE_EXTERNAL else 'a soft'} link, which is not followed"
            group += b"/"
        return None


class Rows:
    """A dataset. Its storage, type and shape are checked when it is opened."""

    def __init__(self, dataset: Any, file: str, file_bytes: int, place: str) -> None:
        self._dataset, self._file_bytes = dataset, file_bytes
        self.where = f"{file} {place}"
        with _reading(self.where):
            self.dtype: np.dtype[Any] = dataset.dtype
            self.shape: tuple[int, ...] = dataset.shape or ()
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
                raise IndexError(f"{self.where} has {len(self)} rows, not {key}")
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
            raise ValueError(f"{self.where} has {self.shape[0] if self.shape else 0} rows; its episode has {length} observations")
        return self

    def _text(self) -> bytes:
        if self.shape or self._dataset.id.get_type().get_class() != _string_class():
            raise ValueError(f"{self.where} is of the type {self.dtype}; it must be numbers or one text")
        if self.dtype.itemsize > limits.SCENE_BYTES:
            raise ValueError(f"{self.where} has {self.dtype.itemsize} bytes, more than {limits.SCENE_BYTES}")
        with _reading(self.where):
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
            raise ValueError(f"has {self.shape[0]} rows, more than {limits.STEPS}")
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
        with _reading(self.where):
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
        without, data = dataset.read_direct_chunk(at)
        # Without filters, h5py gives as many bytes as a whole chunk has, and does not fill those that are not stored.
        data = data[:stored]
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


def _string_class() -> int:
    return optional("h5py.h5t", "dataset", "Reading recordings").STRING


@contextlib.contextmanager
def _reading(where: str) -> Iterator[None]:
    """Errors of the HDF5 library and of the checks, with the place."""
    try:
        yield
    except _ERRORS as error:
        text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
        raise ValueError(
            f"{where} {text}" if not isinstance(error, (KeyError, OSError, RuntimeError)) else f"{where} cannot be read: {text}"
        ) from None
