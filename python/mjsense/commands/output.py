# SPDX-License-Identifier: Apache-2.0
"""What the commands print: tables, trees of files, sizes, and lines for people on stderr."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence


def tell(text: str) -> None:
    """Prints a line on stderr. The program continues if it cannot be written, because the terminal is gone or the disk is full.

    Characters that control a terminal become ``?``, because names in the text may come from files of others.
    """
    from mjsense.core.errors import printable  # slow to import

    print(printable(text), file=sys.stderr)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Lines of columns. ``right``: the columns that are aligned to the right."""
    from mjsense.core.errors import printable

    shown = [[printable(cell).replace("\n", "?") for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*shown)]
    lines = [
        "  ".join(cell.rjust(width) if i in right else cell.ljust(width) for i, (cell, width) in enumerate(zip(row, widths)))
        for row in shown
    ]
    return "\n".join(line.rstrip(" ") for line in lines)


def bytes_text(size: float) -> str:
    """``412 B``, ``3.4 kB``, ``1.2 MB``"""
    units = ["B", "kB", "MB", "GB", "TB"]
    while size >= 999.5 and len(units) > 1:
        size, units = size / 1000, units[1:]
    return f"{size:.0f} {units[0]}" if units[0] == "B" or size >= 99.95 else f"{size:.1f} {units[0]}"


def tree(folder: str, maximum: int = 40) -> str:
    """The files below a folder and their sizes. Of a folder with more than ``maximum`` entries the first ones are shown."""
    return "\n".join([folder, *_branches(folder, "", maximum)])


def _branches(folder: str, indent: str, maximum: int) -> list[str]:
    entries = sorted(os.scandir(folder), key=lambda entry: os.fsencode(entry.name))
    shown = maximum - 1 if len(entries) > maximum else len(entries)
    lines = []
    for i, entry in enumerate(entries[:shown]):
        last = i + 1 == len(entries)
        head = f"{indent}{'└── ' if last else '├── '}{entry.name}"
        if entry.is_dir():
            lines += [f"{head}/", *_branches(entry.path, indent + ("    " if last else "│   "), maximum)]
        else:
            lines.append(f"{head}  {bytes_text(entry.stat().st_size)}")
    return lines if shown == len(entries) else [*lines, f"{indent}└── ... {len(entries) - shown} more"]


def bytes_below(folder: str) -> int:
    """Size of the files in a folder and its folders."""
    return sum(os.path.getsize(os.path.join(place, name)) for place, _, names in os.walk(folder) for name in names)
