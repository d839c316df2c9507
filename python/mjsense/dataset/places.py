# SPDX-License-Identifier: Apache-2.0
"""Names that come from files are names, not paths: each is that of a regular file in one folder."""

from __future__ import annotations

import errno
import io
import os
import stat
from pathlib import Path

from mjsense.core.input_files import missing
from mjsense.dataset.limits import NAME_BYTES, SPARSE_FREE, SPARSE_RATIO

_KINDS = ((stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))


def is_plain_name(name: str) -> bool:
    """Whether this is a file name without a folder: not empty, without a separator and control characters, and not ``.`` or
    ``..``."""
    if not name or name in (".", "..") or "/" in name or len(name) > NAME_BYTES:
        return False
    return (
        all(ord(c) >= 0x20 and not 0x7F <= ord(c) < 0xA0 and not 0xD800 <= ord(c) < 0xE000 for c in name)
        and len(name.encode()) <= NAME_BYTES
    )


def printable(text: str) -> str:
    """Text of a file for a terminal: control characters, and those that change the direction of writing, become ``?``."""
    return "".join(c if c.isprintable() else "?" for c in text)


def plain_name(name: str, what: str) -> str:
    """The name, if it is a plain file name.

    Args:
        what: What has the name, for the error: ``"data/house_0/x.h5 traj_0: the video of 'wrist_camera'"``.
    """
    if not is_plain_name(name):
        raise ValueError(f"{what} is named '{printable(name[:100])}'; it must be a plain file name, without a folder")
    return name


class PlainFile(io.FileIO):
    """A regular file that is open for reading. ``identity`` changes if the file is replaced or written to."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "rb")
        about = os.fstat(descriptor)
        self.size = about.st_size
        self.identity = (about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns)


def open_plain(path: Path) -> PlainFile:
    """Opens a file relative to its folder: no symbolic link, pipe, device or folder, and no file that is mostly a hole."""
    plain_name(path.name, f"{path.parent}: a file")
    try:
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except FileNotFoundError:
        raise missing(path) from None
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        descriptor = os.open(path.name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
    except FileNotFoundError:
        raise missing(path) from None
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(f"{path}: is a symbolic link, which is not followed; copy the file that it names") from None
        raise type(error)(f"{path}: cannot be opened: {error.strerror}") from None
    finally:
        os.close(folder)
    about = os.fstat(descriptor)
    wrong = ""
    if stat.S_ISDIR(about.st_mode):
        os.close(descriptor)
        raise IsADirectoryError(f"{path}: is a directory, not a file")
    if not stat.S_ISREG(about.st_mode):
        wrong = f"is {next((kind for test, kind in _KINDS if test(about.st_mode)), 'a device')}, not a file"
    elif (
        about.st_size > SPARSE_FREE
        and about.st_size > SPARSE_RATIO * 512 * about.st_blocks
        and _has_hole(descriptor, about.st_size)
    ):
        wrong = f"declares {about.st_size} bytes but stores {512 * about.st_blocks}: it is not read"
    if wrong:
        os.close(descriptor)
        raise OSError(f"{path}: {wrong}")
    return PlainFile(descriptor)


def read_plain(path: Path, most: int) -> bytes:
    """The bytes of a file, which is opened as by :func:`open_plain` and has at most so many."""
    with open_plain(path) as file:
        if file.size > most:
            raise ValueError(f"{path} has {file.size} bytes, more than {most}")
        return file.read(most)


def _has_hole(descriptor: int, size: int) -> bool:
    """Some network file systems report that no blocks are allocated; they report no holes either."""
    found = os.lseek(descriptor, 0, os.SEEK_HOLE) < size
    os.lseek(descriptor, 0, os.SEEK_SET)
    return found


def plain_folder(path: Path) -> Path:
    """The path, if it is a folder and no link."""
    if path.is_symlink():
        raise OSError(f"{path}: is a symbolic link, which is not followed; copy the folder that it names")
    return path
