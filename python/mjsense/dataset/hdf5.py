# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of recordings, which are not trusted: every object and value is checked.

Only hard links are followed, so nothing outside of the file is read. ``hdf5_rows.py`` checks and reads datasets,
``hdf5_values.py`` attributes.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import unreadable
from mjsense.core.optional import optional
from mjsense.dataset import limits
from mjsense.dataset.hdf5_rows import Rows
from mjsense.dataset.hdf5_values import ERRORS, Attributes, reading
from mjsense.dataset.places import is_plain_name, open_plain, printable


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
        with reading(where):
            found = self._group[path]
            is_dataset = hasattr(found, "dtype") and hasattr(found, "shape")
        if is_dataset:
            return Rows(found, self._file, self._file_bytes, self._below(path))
        if not hasattr(found, "keys"):
            raise ValueError(f"{where} is neither a group nor a dataset")
        return Group(found, self._file, self._file_bytes, self._below(path))

    def get(self, path: str, default: Any = None) -> Any:
        """The group or dataset, or the default if there is none."""
        return default if self._links(path) == "does not exist" else self[path]

    def names(self) -> list[str]:
        """Names of the group's members."""
        with reading(self.where):
            if len(self._group) > limits.NAMES:
                raise ValueError(f"has {len(self._group)} members, more than {limits.NAMES}")
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

        with reading(self.where):
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
            except ERRORS:
                return "does not exist"
            if kind != h5l.TYPE_HARD:
                return f"is {'an external' if kind == h5l.TYPE_EXTERNAL else 'a soft'} link, which is not followed"
            group += b"/"
        return None
