#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the includes between rooms (the folders of src/mjsense), whose order the table in docs/architecture.md defines, and the
namespaces of rooms.

A file may include headers of its own room and of the rooms above it in that table. Tests, benchmarks and folders testing/ may
include anything. Nothing in src/ may include python/. x.cc must include x.h first, which shows that the header is
self-contained.

The namespace of a room is mjsense::ROOM, that of core/ is mjsense. Folders testing/ may use mjsense::testing. In other namespaces of the
library, a file may only declare types and specialise templates.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "src" / "mjsense"
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
FIRST = re.compile(r'^\s*#\s*include\s+[<"]([^">]+)[">]', re.MULTILINE)
NAMESPACE = re.compile(r"^namespace (mjsense[\w:]*) \{\n(.*?)^\}  // namespace \1$", re.MULTILINE | re.DOTALL)
DECLARATIONS = re.compile(r"\s*(template <>\n.*|((class|struct|enum class) \w+;\s*)*)", re.DOTALL)
JUDGES = re.compile(r"_(test|bench)\.cc$|/testing/")


def rooms_of(page: str) -> list[str]:
    """The first column of the table in the section "## Rooms", in order."""
    table = page.split("## Rooms", 1)[1].split("\n## ", 1)[0]
    return re.findall(r"^\| `([a-z0-9]+)/", table, re.MULTILINE)


def wrong_includes(path: Path, text: str, order: dict[str, int]) -> list[str]:
    room = path.parts[0]
    found = []
    for include in INCLUDE.findall(text):
        target = include.removeprefix("mjsense/").split("/")[0]
        if include.startswith("python/"):
            found.append(f"{path}: includes {include}: src/ must not depend on the bindings")
        elif not include.startswith("mjsense/") or "/" not in include.removeprefix("mjsense/"):
            continue
        elif target not in order:
            found.append(f"{path}: includes {include}: room '{target}' is not in docs/architecture.md")
        elif order[target] > order[room]:
            found.append(f"{path}: includes {include}: {room}/ must not depend on {target}/")
    header = (SOURCES / path).with_suffix(".h")
    first = FIRST.search(text)
    if path.suffix == ".cc" and header.exists() and (first is None or first[1] != f"mjsense/{path.with_suffix('.h')}"):
        found.append(f"{path}: includes {first and first[1]} before {header.name}")
    return found


def wrong_namespaces(path: Path, text: str, order: dict[str, int]) -> list[str]:
    room = path.parts[0]
    found = []
    for name, body in NAMESPACE.findall(text):
        owner = name.split("::")[1] if "::" in name else "core"
        if owner not in order:  # mjsense::os
            owner = "core"
        helpers = name == "mjsense::testing" and "testing" in path.parts
        if owner != room and not helpers and not DECLARATIONS.fullmatch(body):
            own = "mjsense" if room == "core" else f"mjsense::{room}"
            found.append(f"{path}: defines names in namespace {name}; the namespace of {room}/ is {own}")
    return found


def main() -> int:
    rooms = rooms_of((ROOT / "docs" / "architecture.md").read_text())
    order = {room: i for i, room in enumerate(rooms)}
    folders = {p.name for p in SOURCES.iterdir() if p.is_dir()}
    found = [f"docs/architecture.md: room '{room}' has no folder" for room in rooms if room not in folders]
    found += [f"src/mjsense/{room}: not in the table of docs/architecture.md" for room in sorted(folders - set(rooms))]
    if not found:
        for path in sorted(SOURCES.rglob("*")):
            name = path.relative_to(SOURCES)
            if path.suffix in (".h", ".cc") and len(name.parts) > 1:
                text = path.read_text()
                found += wrong_namespaces(name, text, order)
                if not JUDGES.search(path.as_posix()):
                    found += wrong_includes(name, text, order)
    print("\n".join(found), file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
