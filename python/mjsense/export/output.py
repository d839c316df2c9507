# SPDX-License-Identifier: Apache-2.0
"""What all exports share: optional libraries, and an output that exists only when it is complete."""

from __future__ import annotations

import contextlib
import importlib
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any


def needs(module: str, extra: str = "export") -> Any:
    """The module ``module`` of an optional library."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"This export needs {module.split('.')[0]}: pip install 'mjsense[{extra}]' ({error})", name=error.name) from error


@contextlib.contextmanager
def new_output(out: str | Path) -> Iterator[Path]:
    """A path next to ``out`` to write to, a file or a folder that is to be made. At the end it is renamed to ``out``; after an error it is
    deleted. ``out`` must not exist, or be an empty folder."""
    final = Path(out)
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
