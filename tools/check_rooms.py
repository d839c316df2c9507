#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the includes between rooms (the folders of src/mjsense and src/mjsense_tasks), whose order the tables in
docs/architecture.md define, the namespaces of rooms, and the imports between the rooms of the Python package (the folders of
python/mjsense).

A file may include headers of its own room and of the rooms above it in those tables; thus the first library does not depend on
the second. Tests, benchmarks and folders testing/ may include headers of later rooms of their library. Nothing in src/ may
include python/. x.cc must include x.h first, which shows that the header is self-contained.

The namespace of a room is mjsense::ROOM or mjsense::tasks::ROOM, that of core/ is mjsense and that of tasks/ is mjsense::tasks.
Folders testing/ may use mjsense::testing. In other namespaces of the libraries, a file may only declare types and specialise
templates.

A Python module may import modules of its own room and of the rooms above it, and no module imports itself through others. Imports
inside functions and those for type checkers (TYPE_CHECKING) count. Texts may not name a module of a later room, as
import_module() takes them.
"""

from __future__ import annotations

import ast
import graphlib
import importlib.util
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "python" / "mjsense"
SOURCES = ROOT / "src"
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
FIRST = re.compile(r'^\s*#\s*include\s+[<"]([^">]+)[">]', re.MULTILINE)
NAMESPACE = re.compile(r"^namespace (mjsense[\w:]*) \{\n(.*?)^\}  // namespace \1$", re.MULTILINE | re.DOTALL)
DECLARATIONS = re.compile(r"\s*(template <>\n.*|((class|struct|enum class) \w+;\s*)*)", re.DOTALL)
MAY_NAME = {"mjsense.core.old_names"}
"""Modules that may name modules of later rooms in texts: the new names of modules."""
JUDGES = re.compile(r"_(test|bench)\.cc$|/testing/")


def rooms_of(page: str) -> list[str]:
    """The first columns of the tables in the section "## Rooms", in order, after the folder in the heading of each table:
    mjsense/core."""
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
    """mjsense/core: mjsense; mjsense/rays: mjsense::rays; mjsense_tasks/tasks: mjsense::tasks; mjsense_tasks/robots:
    mjsense::tasks::robots."""
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


def python_rooms_of(page: str) -> list[str]:
    """The first column of the table in the section "## The Python package"."""
    section = page.split("## The Python package", 1)[1].split("\n## ", 1)[0]
    return re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)


def enclosing(name: str) -> Iterator[str]:
    """A name, then the names of the packages that contain it."""
    while name:
        yield name
        name = name.rpartition(".")[0]


def imported_names(tree: ast.Module, package: str) -> Iterator[str]:
    """Full names of what a module imports anywhere: modules, or attributes of modules."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            yield from (f"{module}.{alias.name}" for alias in node.names)


def named_in_texts(tree: ast.Module, root: str) -> Iterator[str]:
    """Names of modules in texts, except docstrings: "mjsense.warp.start:simulation", f"mjsense.commands.{name}"."""
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) and id(node) not in docstrings else None
        if isinstance(text, str) and (found := re.fullmatch(rf"({root}\.[\w.]+?)\.?(:\w+)?", text)):
            yield found[1]


def files_of(root: Path) -> dict[str, Path]:
    """The files of the package in the folder `root` by the names of the modules."""
    names = {path: ".".join(path.relative_to(root.parent).with_suffix("").parts) for path in root.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for path, name in names.items()}


def import_graph(root: Path) -> dict[str, set[str]]:
    """Module -> modules of the package in the folder `root` that it imports. A package imported with a module counts unless it
    contains the importing module: it is then being loaded already."""
    files = files_of(root)
    compiled = f"{root.name}._core"  # imports nothing from the package when it is loaded
    graph: dict[str, set[str]] = {}
    for module, path in files.items():
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        graph[module] = set()
        for name in imported_names(ast.parse(path.read_text()), package):
            chain = [part for part in enclosing(name) if part in files or part == compiled]
            new = [part for part in chain if part not in enclosing(module)]
            graph[module].update(new or chain[:1])
    return graph


def circle_in(graph: dict[str, set[str]]) -> str:
    """A circle as "a -> b -> a" (a imports b), or "" if there is none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return " -> ".join(reversed(error.args[1]))
    return ""


def wrong_imports(root: Path, rooms: list[str]) -> list[str]:
    folders = sorted(path.parent.name for path in root.glob("*/__init__.py"))
    flat = {path.stem for path in root.glob("*.py")} - {"__init__", "__main__"}
    found = [f"docs/architecture.md: room '{room}' has no folder in {root.name}/" for room in rooms if room not in folders]
    found += [f"{root.name}/{room}/: not in the table of docs/architecture.md" for room in folders if room not in rooms]
    found += [f"{root.name}/{name}.py: a module must be in a room" for name in sorted(flat)]
    order = {f"{root.name}.{room}": i for i, room in enumerate(rooms)}
    graph, files = import_graph(root), files_of(root)
    for module, imported in sorted(graph.items()):
        own = order.get(".".join(module.split(".")[:2]), len(order))  # __init__ and __main__ may import every room
        texts = set() if module in MAY_NAME else set(named_in_texts(ast.parse(files[module].read_text()), root.name))
        for verb, names in ("imports", imported), ("names", texts):
            rooms_of_names = {".".join(name.split(".")[:2]) for name in names}
            found += [f"{module}: {verb} {room}, a later room" for room in sorted(rooms_of_names) if order.get(room, -1) > own]
    if circle := circle_in(graph):
        found.append(f"imports in a circle: {circle}")
    return found


def main() -> int:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rooms = rooms_of(page)
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
    found += wrong_imports(PACKAGE, python_rooms_of(page))
    print("\n".join(found), file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
