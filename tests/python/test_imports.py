# SPDX-License-Identifier: Apache-2.0
"""The order of the package's rooms, and names of modules."""

import importlib
import importlib.util
import inspect
import re
import sys
import warnings
from pathlib import Path

import pytest

import mjsense
from mjsense.core import later_rooms
from mjsense.core.old_names import OLD_NAMES

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "mjsense"
sys.path.insert(0, str(PACKAGE.parents[1] / "tools"))

import check_rooms


def test_the_package_has_neither_later_rooms_nor_circles():
    graph = check_rooms.import_graph(PACKAGE)
    assert "mjsense.scene.scene" in graph["mjsense.sim.simulation"] and "mjsense.compat.peer.env" in graph["mjsense.compat.peer"]
    rooms = check_rooms.python_rooms_of((PACKAGE.parents[1] / "docs" / "architecture.md").read_text())
    assert len(rooms) > 10 and check_rooms.wrong_imports(PACKAGE, rooms) == []


def test_modules_of_later_rooms_have_the_names_that_earlier_ones_use():
    assert len(later_rooms.PLACES) > 5
    for place in later_rooms.PLACES.values():
        module, _, name = place.partition(":")
        spec = importlib.util.find_spec(module)
        assert spec is not None and spec.origin is not None, place
        assert re.search(rf"^(def|class) {name}\b|^{name} =", Path(spec.origin).read_text(), re.MULTILINE), place


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
        for name in set(mjsense.tasks.__all__) & set(mjsense.__all__):
            assert getattr(mjsense.tasks, name) is getattr(mjsense, name)


@pytest.mark.parametrize(
    "a, b, circle",
    [
        ("from made import b", "from made.a import f", True),
        ("import made.b", "def g():\n    from . import a", True),
        ("from made.b import g", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from made import a", True),
        ("from made import b", "", False),
        ("", "from made import f", True),  # a name of the package itself, whose __init__.py imports b
    ],
)
def test_circles_are_found(a, b, circle, tmp_path):
    root = made(tmp_path, {"__init__": "from made import a, b\nfrom made.a import f\n", "a": a, "b": b})
    assert bool(check_rooms.circle_in(check_rooms.import_graph(root))) == circle


def test_imports_of_later_rooms_are_found(tmp_path):
    code = {"__init__": "", "first/__init__": "", "first/a": "def f():\n    import made.second.b", "first/c": "'''made.second.b'''\nX = f'made.second.{1}'", "second/__init__": "",
            "second/b": "from made.first import c", "flat": ""}  # fmt: skip
    assert check_rooms.wrong_imports(made(tmp_path, code), ["first", "second", "third"]) == [
        "docs/architecture.md: room 'third' has no folder in made/",
        "made/flat.py: a module must be in a room",
        "made.first.a: imports made.second, a later room",
        "made.first.c: names made.second, a later room",
    ]


def made(folder, code):
    """A package of these modules."""
    for name, text in code.items():
        path = folder / "made" / f"{name}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return folder / "made"
