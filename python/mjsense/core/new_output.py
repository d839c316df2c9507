# SPDX-License-Identifier: Apache-2.0
"""An output that exists only when it is complete, and temporary folders next to it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

_MARK = ".mjsense_part"
"""File in each folder of :func:`own_folder`, which the process that uses it locks."""


@contextlib.contextmanager
def new_output(out: str | Path) -> Iterator[Path]:
    """A path in the folder ``OUT.part`` to write to, a file or a folder that is to be made. At the end it is renamed to ``out``;
    after an error it is deleted. ``out`` must not exist, or be an empty folder, and no other process may write it."""
    with part_of(Path(out)) as part, complete_output(Path(out), part) as path:
        yield path


def expect_folder(path: Path) -> None:
    """Raises an error if the folder of a file that is written after much work does not exist."""
    if not path.parent.is_dir():
        raise FileNotFoundError(f"cannot write '{path}': there is no directory '{path.parent}'")


@contextlib.contextmanager
def part_of(final: Path) -> Iterator[Path]:
    """The folder ``OUT.part``, for the process that writes ``final``."""
    with own_folder(final.with_name(f"{final.name}.part"), f"another process writes {final}") as folder:
        yield folder


@contextlib.contextmanager
def own_folder(path: Path, in_use: str) -> Iterator[Path]:
    """A new folder for this process, which is deleted at the end. One that a killed process has left is emptied and used; a
    folder or file of another origin stays as it is and is an error.

    Args:
        in_use: Message of the FileExistsError if another process uses it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    mark = path / _MARK
    try:
        path.mkdir()
        mark.touch()
    except FileExistsError:
        if not mark.is_file():
            raise FileExistsError(
                f"{path} exists, and no program of mjsense has made it: rename it, or choose another output"
            ) from None
    with _locked(mark, in_use):
        _empty(path)
        try:
            yield path
        finally:
            _empty(path)
            mark.unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # it contains a file of another program
                path.rmdir()


@contextlib.contextmanager
def _locked(path: Path, in_use: str) -> Iterator[None]:
    """Holds the lock of a file, which ends with the process."""
    with contextlib.ExitStack() as stack:
        try:
            lock = stack.enter_context(open(path, "r+"))
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            mine = os.path.samestat(os.stat(path), os.fstat(lock.fileno()))  # the process that had the lock removes the file
        except (BlockingIOError, FileNotFoundError):
            mine = False
        if not mine:
            raise FileExistsError(in_use)
        yield


@contextlib.contextmanager
def complete_output(final: Path, part: Path) -> Iterator[Path]:
    """As :func:`new_output`, in the folder ``part`` of this process."""
    if final.exists() and not (final.is_dir() and not any(final.iterdir())):
        raise FileExistsError(f"{final} exists; name another output, or delete it")
    path = part / final.name
    try:
        yield path
        if final.is_dir():
            final.rmdir()
        path.rename(final)
    finally:
        _delete(path)


def _empty(folder: Path) -> None:
    """Deletes everything in a folder but its mark."""
    for path in folder.iterdir():
        if path.name != _MARK:
            _delete(path)


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
