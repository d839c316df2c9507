# SPDX-License-Identifier: Apache-2.0
"""What all exports share: optional libraries, and their output."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mjsense.core.new_output import complete_output, new_output, own_folder, part_of
from mjsense.core.optional import optional

__all__ = ["complete_output", "join_folders", "needs", "new_output", "own_folder", "part_of"]


def needs(module: str, extra: str = "export") -> Any:
    """The module ``module`` of an optional library."""
    return optional(module, extra, "This export")


def join_folders(source: Any, parts: Iterable[Path], path: Path) -> None:
    """Writes the new folder ``path`` with the files of several folders, which are moved."""
    path.mkdir()
    for part in parts:
        for file in part.iterdir():
            file.rename(path / file.name)
