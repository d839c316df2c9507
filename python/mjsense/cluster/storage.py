# SPDX-License-Identifier: Apache-2.0
"""The output directory of a job, on any file system that fsspec knows."""

from __future__ import annotations

from pathlib import Path

from mjsense.dataset.limits import OBJECT_BYTES
from mjsense.dataset.remote import open_address, read_object


class Storage:
    """Files by their paths relative to the root."""

    def __init__(self, root: str) -> None:
        self._fs, self._root = open_address(root)

    def _path(self, path: str) -> str:
        return f"{self._root}/{path}"

    def write(self, path: str, data: bytes) -> None:
        """Writes a file that appears with all of its content."""
        part = self._path(path + ".part")
        self._fs.makedirs(part.rsplit("/", 1)[0], exist_ok=True)
        self._fs.pipe_file(part, data)
        self._fs.mv(part, self._path(path))

    def read(self, path: str) -> bytes | None:
        """None if there is no such file."""
        return read_object(self._fs, self._path(path))

    def read_all(self, pattern: str) -> list[bytes]:
        """The contents of the files that match a glob pattern, which object stores read in parallel."""
        sizes = {path: about["size"] for path, about in self._fs.glob(self._path(pattern), detail=True).items()}
        if not sizes:
            return []
        if sum(sizes.values()) > OBJECT_BYTES:
            raise ValueError(f"{self._path(pattern)}: the files have {sum(sizes.values())} bytes, more than {OBJECT_BYTES}")
        found = self._fs.cat(list(sizes))
        return list(found.values()) if isinstance(found, dict) else [found]

    def exists(self, path: str) -> bool:
        """Whether there is such a file."""
        return self._fs.exists(self._path(path))

    def remove(self, path: str) -> None:
        """Removes a file."""
        self._fs.rm_file(self._path(path))

    def find(self, pattern: str) -> list[str]:
        """Paths that match a glob pattern."""
        return [str(found)[len(self._root) + 1 :] for found in self._fs.glob(self._path(pattern))]

    def put_folder(self, local: Path, path: str) -> None:
        """Copies a local folder. Files that are already there are replaced.

        Args:
            path: The folder's path; empty: the root.
        """
        for file in sorted(local.rglob("*")):
            if file.is_file():
                target = self._path(f"{path}/{file.relative_to(local)}".lstrip("/"))
                self._fs.makedirs(target.rsplit("/", 1)[0], exist_ok=True)
                self._fs.put_file(str(file), target)
