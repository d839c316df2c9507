# SPDX-License-Identifier: Apache-2.0
"""The order of the package's rooms, and names of modules.

No module imports itself through other modules, neither at its top nor inside a function. An import inside a function hides a cycle, so
it counts like one at the top of the file. Imports for type checkers only (``if TYPE_CHECKING``) do not count.
"""

import ast
import graphlib
import importlib
import importlib.util
import inspect
import re
import warnings
from pathlib import Path

import pytest

import mjsense
from mjsense.core.old_names import OLD_NAMES

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


UPWARD = {
    "mjsense.sim.simulation": {"compat"},
    "mjsense.dataset.sensor_check": {"tasks"},
    "mjsense.dataset.sensor_tables": {"tasks"},
    "mjsense.exporting.robomimic": {"tasks"},
    "mjsense.viewer.open": {"tasks"},
    "mjsense.viewer.source": {"tasks"},
    "mjsense.tasks.recording": {"cluster"},
}
"""Modules that import rooms below theirs in the table."""


def rooms_of(page):
    """The rooms of the Python package in the order of the table in docs/architecture.md."""
    table = page.split("## The Python package", 1)[1].split("\n## ", 1)[0]
    return re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)


def test_rooms_import_only_rooms_above_them():
    rooms = rooms_of((PACKAGE.parents[1] / "docs" / "architecture.md").read_text())
    assert sorted(rooms) == sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py"))
    assert {path.stem for path in PACKAGE.glob("*.py")} == {"__init__", "__main__"}
    found = {}
    for module, imported in import_graph(PACKAGE).items():
        room = module.split(".")[1] if "." in module else "__init__"
        if room not in ("__init__", "__main__"):
            others = {name.split(".")[1] for name in imported if "." in name} & set(rooms)
            found[module] = {other for other in others if rooms.index(other) > rooms.index(room)}
    assert {module: others for module, others in found.items() if others} == UPWARD


def packages(root):
    return [".".join(path.parent.relative_to(root.parent).parts) for path in sorted(root.rglob("__init__.py"))]


@pytest.mark.parametrize("name", [name for name in packages(PACKAGE) if not name.startswith(("mjsense.compat.mjlab", "mjsense.warp"))])
def test_no_function_hides_a_module(name):
    package = importlib.import_module(name)
    functions = [public for public in dir(package) if inspect.isfunction(getattr(package, public))]
    folder = Path(package.__file__).parent
    assert [public for public in functions if (folder / f"{public}.py").exists() or (folder / public).is_dir()] == []


@pytest.mark.parametrize("old", OLD_NAMES)
def test_old_names_of_modules_give_the_new_ones(old):
    assert importlib.util.find_spec(OLD_NAMES[old])
    found, new = importlib.import_module(old), pytest.importorskip(OLD_NAMES[old])  # some need packages of others
    assert inspect.ismodule(found) and new.__name__ == OLD_NAMES[old]
    public = next((name for name in vars(new) if name[0] != "_"), None)
    if public is not None:  # a package without names of its own
        with pytest.warns(DeprecationWarning, match=f"^{old} is now {OLD_NAMES[old]}$") as caught:
            assert getattr(found, public) is getattr(new, public)
        assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning), pytest.raises(AttributeError, match="no_such_name"):
        _ = found.no_such_name


def test_public_names_of_modules_do_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert mjsense.effects.Noise is mjsense.sensors.effects.Noise and mjsense.observations.height_scan
        for name in mjsense.tasks.__all__:
            assert getattr(mjsense.tasks, name) is getattr(mjsense, name)


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
