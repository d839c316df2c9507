# SPDX-License-Identifier: Apache-2.0
"""What all exports share: optional libraries, and an output that exists only when it is complete."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mjsense._optional import optional


def needs(module: str, extra: str = "export") -> Any:
    """The module ``module`` of an optional library."""
    return optional(module, extra, "This export")


@contextlib.contextmanager
def new_output(out: str | Path) -> Iterator[Path]:
    """A path next to ``out`` to write to, a file or a folder that is to be made. At the end it is renamed to ``out``; after an error it is
    deleted. ``out`` must not exist, or be an empty folder, and no other process may write it."""
    with only_writer(Path(out)), unlocked_output(Path(out)) as path:
        yield path


@contextlib.contextmanager
def only_writer(final: Path) -> Iterator[None]:
    """Holds the lock ``OUT.lock``, which ends with the process. Raises FileExistsError if another process has it."""
    final.parent.mkdir(parents=True, exist_ok=True)
    path = final.with_name(f"{final.name}.lock")
    with open(path, "a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            mine = os.path.samestat(os.stat(path), os.fstat(lock.fileno()))  # the process that had the lock removes the file
        except (BlockingIOError, FileNotFoundError):
            mine = False
        if not mine:
            raise FileExistsError(f"another process writes {final}")
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


@contextlib.contextmanager
def unlocked_output(final: Path) -> Iterator[Path]:
    """As :func:`new_output`, where the caller makes sure that no other process writes ``final``."""
    if final.exists() and not (final.is_dir() and not any(final.iterdir())):
        raise FileExistsError(f"{final} exists; name another output, or delete it")
    part = final.with_name(f"{final.name}.part")
    _delete(part)
    final.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield part
        if final.is_dir():
            final.rmdir()
        part.rename(final)
    finally:
        _delete(part)


def join_folders(source: Any, parts: Iterable[Path], out: Path) -> None:
    """Writes the new folder ``out`` with the files of several folders, which are moved."""
    with new_output(out) as path:
        path.mkdir()
        for part in parts:
            for file in part.iterdir():
                file.rename(path / file.name)


def _delete(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
