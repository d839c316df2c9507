# SPDX-License-Identifier: Apache-2.0
"""Files that a user names: their contents, or an error that says what is wrong with which file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path
from typing import Any

from mjsense.core.errors import did_you_mean

_MAX_NAMES = 1000


def missing(path: Path) -> FileNotFoundError:
    """The error for a path that does not exist, with the nearest names that do."""
    if not path.parent.is_dir():
        return FileNotFoundError(f"{path}: no such file or directory; there is no directory '{path.parent}'")
    try:
        names = [one.name for one in islice(path.parent.iterdir(), _MAX_NAMES)]
    except OSError:  # the directory cannot be listed
        names = []
    return FileNotFoundError(f"{path}: no such file or directory{did_you_mean(path.name, names)}")


def expect_no_folder(name: str, file: str, known: Callable[[], Iterable[str]]) -> None:
    """Raises an error for ``lab_arm`` in place of ``lab_arm/robot.toml``, unless it is a known name."""
    if Path(name, file).is_file() and name not in known():
        raise IsADirectoryError(f"'{name}' is a folder; pass the file '{Path(name, file)}'")


def unreadable(path: Path, error: OSError, kind: str = "") -> OSError:
    """The error for a path that could not be opened or read.

    Args:
        error: The error of the attempt.
        kind: What the file should be, if the attempt also checks that: ``"an HDF5 file"``.
    """
    if not path.exists():
        return missing(path)
    if path.is_dir():
        return IsADirectoryError(f"{path}: is a directory, not a file")
    if kind and not isinstance(error, PermissionError):
        return OSError(f"{path}: not {kind} that can be read: {error}")
    return type(error)(f"{path}: cannot be read: {error.strerror or error}")


def read_text(path: str | Path) -> str:
    """The contents of a file in UTF-8."""
    path = Path(path)
    try:
        return path.read_bytes().decode()
    except OSError as error:
        raise unreadable(path, error) from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not a text file in UTF-8: invalid byte at position {error.start}") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """The table of a TOML file."""
    import tomllib  # slow to import

    text = read_text(path)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: not valid TOML: it is nested too deeply") from None
