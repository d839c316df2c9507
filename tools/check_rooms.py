#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the includes between rooms (the folders of src/mjsense and src/mjsense_tasks), whose order the tables in docs/architecture.md
define, and the namespaces of rooms.

A file may include headers of its own room and of the rooms above it in those tables; thus the first library does not depend on the second.
Tests, benchmarks and folders testing/ may include headers of later rooms of their library. Nothing in src/ may include python/. x.cc must
include x.h first, which shows that the header is self-contained.

The namespace of a room is mjsense::ROOM or mjsense::tasks::ROOM, that of core/ is mjsense and that of tasks/ is mjsense::tasks. Folders
testing/ may use mjsense::testing. In other namespaces of the libraries, a file may only declare types and specialise templates.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "src"
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
FIRST = re.compile(r'^\s*#\s*include\s+[<"]([^">]+)[">]', re.MULTILINE)
NAMESPACE = re.compile(r"^namespace (mjsense[\w:]*) \{\n(.*?)^\}  // namespace \1$", re.MULTILINE | re.DOTALL)
DECLARATIONS = re.compile(r"\s*(template <>\n.*|((class|struct|enum class) \w+;\s*)*)", re.DOTALL)
JUDGES = re.compile(r"_(test|bench)\.cc$|/testing/")


def rooms_of(page: str) -> list[str]:
    """The first columns of the tables in the section "## Rooms", in order, after the folder in the heading of each table: mjsense/core."""
    section = page.split("## Rooms", 1)[1].split("\n## ", 1)[0]
    rooms = []
    for part in section.split("\n### ")[1:]:
        heading = re.match(r".*`src/(\w+)/`", part)
        if heading is None:
            raise ValueError(f"docs/architecture.md: the heading '{part.splitlines()[0]}' does not name a folder `src/LIBRARY/`")
        rooms += [f"{heading[1]}/{room}" for room in re.findall(r"^\| `([a-z0-9]+)/", part, re.MULTILINE)]
    return rooms


def room_of(file: Path | str) -> str:
    """The room of a file below src/: mjsense/core."""
    return "/".join(Path(file).parts[:2])


def wrong_includes(path: Path, text: str, order: dict[str, int]) -> list[str]:
    room, judges = room_of(path), JUDGES.search(path.as_posix())
    found = []
    for include in INCLUDE.findall(text):
        target = room_of(include)
        if include.startswith("python/"):
            found.append(f"{path}: includes {include}: src/ must not depend on the bindings")
        elif not include.startswith("mjsense") or include.count("/") < 2:
            continue
        elif target not in order:
            found.append(f"{path}: includes {include}: room '{target}' is not in docs/architecture.md")
        elif order[target] > order[room] and not (judges and target.split("/")[0] == room.split("/")[0]):
            found.append(f"{path}: includes {include}: {room}/ must not depend on {target}/")
    header = (SOURCES / path).with_suffix(".h")
    first = FIRST.search(text)
    if path.suffix == ".cc" and not judges and header.exists() and (first is None or first[1] != str(path.with_suffix(".h"))):
        found.append(f"{path}: includes {first and first[1]} before {header.name}")
    return found


def namespace_of(room: str) -> str:
    """mjsense/core: mjsense; mjsense/rays: mjsense::rays; mjsense_tasks/tasks: mjsense::tasks; mjsense_tasks/robots: mjsense::tasks::robots."""
    names = room.replace("mjsense_tasks", "mjsense::tasks").split("/")
    return names[0] if room in ("mjsense/core", "mjsense_tasks/tasks") else "::".join(names)


def wrong_namespaces(path: Path, text: str, order: dict[str, int]) -> list[str]:
    own = namespace_of(room_of(path))
    namespaces = {namespace_of(room) for room in order}
    found = []
    for name, body in NAMESPACE.findall(text):
        # The namespace of a room that has or contains this one: mjsense for mjsense::os.
        owner = max((n for n in namespaces if f"{name}::".startswith(f"{n}::")), key=len)
        helpers = name == "mjsense::testing" and "testing" in path.parts
        if owner != own and not helpers and not DECLARATIONS.fullmatch(body):
            found.append(f"{path}: defines names in namespace {name}; the namespace of {room_of(path)}/ is {own}")
    return found


def main() -> int:
    rooms = rooms_of((ROOT / "docs" / "architecture.md").read_text())
    order = {room: i for i, room in enumerate(rooms)}
    folders = {p.relative_to(SOURCES).as_posix() for p in SOURCES.glob("*/*") if p.is_dir()}
    found = [f"docs/architecture.md: room '{room}' has no folder in src/" for room in rooms if room not in folders]
    found += [f"src/{room}: not in the tables of docs/architecture.md" for room in sorted(folders - set(rooms))]
    if not found:
        for path in sorted(SOURCES.rglob("*")):
            name = path.relative_to(SOURCES)
            if path.suffix in (".h", ".cc") and len(name.parts) > 2:
                text = path.read_text()
                found += wrong_namespaces(name, text, order) + wrong_includes(name, text, order)
    print("\n".join(found), file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
