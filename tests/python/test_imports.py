# SPDX-License-Identifier: Apache-2.0
"""No module of the package imports itself through other modules, neither at its top nor inside a function.

An import inside a function hides a cycle, so it counts like one at the top of the file. Imports for type checkers only
(``if TYPE_CHECKING``) do not count. No exceptions are needed at present.
"""

import ast
import graphlib
import importlib.util
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "mjsense"
COMPILED = {"mjsense._core"}  # modules without a file in PACKAGE; they import nothing from it when they are loaded


def import_statements(node):
    """Import statements at any depth that are executed at run time."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            yield from import_statements(ast.Module(child.orelse, []))
        elif isinstance(child, (ast.Import, ast.ImportFrom)):
            yield child
        else:
            yield from import_statements(child)


def imported_names(statement, package):
    """Full names of what a statement imports: modules, or attributes of modules."""
    if isinstance(statement, ast.Import):
        return [alias.name for alias in statement.names]
    module = importlib.util.resolve_name("." * statement.level + (statement.module or ""), package)
    return [f"{module}.{alias.name}" for alias in statement.names]


def enclosing(name):
    """A name, then the names of the packages that contain it."""
    while name:
        yield name
        name = name.rpartition(".")[0]


def import_graph(root):
    """Module -> modules of the package `root` that it imports. A package imported with a module counts unless it contains the
    importing module: it is then being loaded already."""
    files = {}
    for path in root.rglob("*.py"):
        name = ".".join(path.relative_to(root.parent).with_suffix("").parts)
        files[name.removesuffix(".__init__")] = path
    graph = {}
    for module, path in files.items():
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        graph[module] = set()
        for statement in import_statements(ast.parse(path.read_text())):
            for name in imported_names(statement, package):
                chain = [part for part in enclosing(name) if part in files or part in COMPILED]
                new = [part for part in chain if part not in enclosing(module)]
                graph[module].update(new or chain[:1])
    return graph


def cycle_in(graph):
    """A cycle as "a -> b -> a" (a imports b), or "" if there is none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return " -> ".join(reversed(error.args[1]))
    return ""


def test_the_package_has_no_import_cycle():
    graph = import_graph(PACKAGE)
    assert "mjsense.scene.scene" in graph["mjsense.sim.simulation"] and "mjsense.compat.peer.env" in graph["mjsense.compat.peer"]
    assert cycle_in(graph) == ""


def allowed_imports(page):
    """Folder of the package -> folders that it may import, from the table in docs/architecture.md."""
    table = page.split("## The Python package", 1)[1].split("\n## ", 1)[0]
    cells = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", table, re.MULTILINE))
    named = {folder: set(re.findall(r"`(\w+)`", cell)) for folder, cell in cells.items()}
    return {
        folder: set(cells) - named[folder] if cell.startswith("all but") else named[folder] & set(cells)
        for folder, cell in cells.items()
    }


def test_folders_import_what_the_architecture_page_allows():
    allowed = allowed_imports((PACKAGE.parents[1] / "docs" / "architecture.md").read_text())
    assert set(allowed) == {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    wrong = []
    for module, imported in import_graph(PACKAGE).items():
        folder = module.split(".")[1] if "." in module else "__init__"
        for other in {name.split(".")[1] for name in imported if "." in name} & set(allowed) - {folder}:
            permitted = allowed.get(folder, {"plot": {"view", "dataset"}, "record": {"export", "cluster"}, "simulation": {"peer", "warp"}}.get(folder, {"peer"}))
            if folder not in ("__init__", "__main__") and other not in permitted:
                wrong.append(f"{module} imports {other}")
    assert not wrong


@pytest.mark.parametrize(
    "a, b, cyclic",
    [
        ("from made import b", "from made.a import f", True),
        ("import made.b", "def g():\n    from . import a", True),
        ("from made.b import g", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from made import a", False),
        ("from made import b", "", False),
        ("", "from made import f", True),  # a name of the package itself, whose __init__.py imports b
    ],
)
def test_cycles_are_found(a, b, cyclic, tmp_path):
    root = tmp_path / "made"
    root.mkdir()
    (root / "__init__.py").write_text("from made import a, b\nfrom made.a import f\n")
    (root / "a.py").write_text(a)
    (root / "b.py").write_text(b)
    assert bool(cycle_in(import_graph(root))) == cyclic
