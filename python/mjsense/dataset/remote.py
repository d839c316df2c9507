# SPDX-License-Identifier: Apache-2.0
"""Recordings at addresses of fsspec, such as ``s3://bucket/pick``: their files are copied to a local folder when they are first
read."""

from __future__ import annotations

import hashlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mjsense.core.optional import optional
from mjsense.dataset.files import INDEX
from mjsense.dataset.limits import OBJECT_BYTES
from mjsense.dataset.places import is_plain_name, printable


def is_address(root: str | Path) -> bool:
    """Whether this is an address instead of a path; a folder may have any name."""
    return "://" in str(root) and not os.path.exists(root)


def absolute(root: str | Path) -> str:
    """The address, or the absolute path."""
    return str(root) if is_address(root) else str(Path(root).resolve())


def open_address(address: str) -> tuple[Any, str]:
    """fsspec's file system of an address or a path, and the path there."""
    url_to_fs = optional("fsspec.core", "ray", address).url_to_fs
    return url_to_fs(address)


def read_object(system: Any, path: str) -> bytes | None:
    """The bytes of an object; None if there is none. Its size is checked before it is read into memory.

    Raises:
        ValueError: It is larger than any that is written.
    """
    try:
        size = system.info(path).get("size")
    except FileNotFoundError:
        return None
    if not isinstance(size, int) or size > OBJECT_BYTES:
        raise ValueError(f"{printable(path)} has {size} bytes, more than {OBJECT_BYTES}")
    return system.cat_file(path)


@dataclass(frozen=True)
class Remote:
    """A recording at an address, and its local copy. A folder that exists in the copy is complete."""

    address: str
    local: Path

    def fetch(self, folder: Path) -> None:
        """Copies a folder of the recording, given by its place in the local copy, if it is not there yet."""
        if folder.exists():
            return
        system, root = open_address(self.address)
        source, part = (
            f"{root}/{folder.relative_to(self.local)}".rstrip("/."),
            folder.with_name(f"{folder.name}.{os.getpid()}.part"),
        )
        if not (found := [str(file) for file in system.find(source)]):
            raise FileNotFoundError(
                f"{self.address}/{folder.relative_to(self.local)} does not exist, but the index of the recording names it"
            )
        shutil.rmtree(part, ignore_errors=True)
        names = [_below(source, file, self.address) for file in found]
        for file, name in zip(found, names):
            target = part / name
            target.parent.mkdir(parents=True, exist_ok=True)
            system.get_file(file, str(target))
        try:
            part.rename(folder)
        except OSError:  # another process was faster
            shutil.rmtree(part, ignore_errors=True)
            if not folder.exists():
                raise


def _below(folder: str, key: str, address: str) -> str:
    """The path of an object in a folder: keys of object storage may contain ``..`` and empty names, which leave the folder."""
    name = key[len(folder) + 1 :]
    if not key.startswith(f"{folder}/") or not all(map(is_plain_name, name.split("/"))):
        raise ValueError(
            f"{address}: the object '{printable(key[-200:])}' is not named as a file of the folder "
            f"'{printable(folder[-200:])}'; nothing was copied"
        )
    return name


def resolved(root: str | Path) -> tuple[Path, Remote | None]:
    """The local folder or file of a recording: of an index the folder that contains it, of an address the local copy.

    Of a recording with an index, only the index is copied here, and the folders of episodes when they are first read. Copies are
    in ``$MJSENSE_CACHE``, by default ``~/.cache/mjsense``; a recording that has changed gets a new one.
    """
    if not is_address(root):
        path = Path(root)
        return (path.parent if path.name == INDEX else path), None
    address = str(root).rstrip("/").removesuffix(f"/{INDEX}")
    system, base = open_address(address)
    if "file" in (protocol := (system.protocol,) if isinstance(system.protocol, str) else system.protocol) or "local" in protocol:
        return Path(base), None
    found = {name: read_object(system, f"{base}/{name}") for name in (INDEX, "job.json")}
    small = {name: content for name, content in found.items() if content is not None}
    if INDEX in small:
        version = small[INDEX]
    elif not (files := system.find(base, detail=True)):
        raise FileNotFoundError(f"{address} contains no recording")
    else:
        version = repr(sorted((name, about.get("size")) for name, about in files.items())).encode()
    cache = Path(os.environ.get("MJSENSE_CACHE") or Path.home() / ".cache/mjsense")
    name = base.rsplit("/", 1)[-1]
    local = (
        cache
        / hashlib.sha256(address.encode() + b"\0" + version).hexdigest()[:16]
        / (name if is_plain_name(name) else "recording")
    )
    remote = Remote(address, local)
    if INDEX not in small:
        local.parent.mkdir(parents=True, exist_ok=True)
        remote.fetch(local)
        return local, None
    local.mkdir(parents=True, exist_ok=True)
    for name, content in small.items():
        part = local / f"{name}.{os.getpid()}.part"
        part.write_bytes(content)
        part.replace(local / name)
    return local, remote
