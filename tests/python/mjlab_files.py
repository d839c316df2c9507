# SPDX-License-Identifier: Apache-2.0
"""mjlab's own task files, read from its wheel, with ``mjsense.compat.mjlab`` in the place of what they import for scene and sensors.

Rewards, managers and other parts of training are replaced by objects that store their arguments.
"""

import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import sys
import types

SWAPPED = ("actuator", "entity", "scene", "sensor", "sim", "terrains", "terrains.config", "utils", "utils.actuator", "utils.spec_config")
SOURCES = ("asset_zoo.robots", "tasks.velocity.config.", "tasks.velocity.velocity_env_cfg", "tasks.manipulation.config.",
           "tasks.manipulation.lift_cube_env_cfg")  # fmt: skip


class _Names(type):
    def __getattr__(cls, name):
        if name.startswith("__"):
            raise AttributeError(name)
        made = _Names(name, (Record,), {})
        setattr(cls, name, made)
        return made


class Record(metaclass=_Names):
    """Stores its arguments as attributes; any other attribute is another Record."""

    def __init__(self, *args, **kwargs):
        vars(self).update(kwargs)
        if args:
            self.terms = args[0]

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        vars(self)[name] = Record()
        return vars(self)[name]


class _StandIn(types.ModuleType):
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        vars(self)[name] = _Names(name, (Record,), {})
        return vars(self)[name]


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, root):
        self.root = root

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] != "mjlab":
            return None
        local = name[len("mjlab.") :]
        file = self.root / name.replace(".", "/")
        package = (file / "__init__.py").exists()
        registers = package and local.startswith("tasks.")  # as an import of their packages would do
        if local and local.startswith(SOURCES) and not registers:
            where = file / "__init__.py" if package else file.with_suffix(".py")
            return importlib.util.spec_from_file_location(name, where, submodule_search_locations=[str(file)] if package else None)
        return importlib.machinery.ModuleSpec(name, self, is_package=True)

    def create_module(self, spec):
        module = _StandIn(spec.name)
        if spec.name == "mjlab":
            module.MJLAB_SRC_PATH = self.root / "mjlab"
        return module

    def exec_module(self, module):
        pass


def load(monkeypatch, root, name):
    """The module ``mjlab.<name>`` of the wheel unpacked in ``root``."""
    for loaded in [m for m in sys.modules if m.partition(".")[0] == "mjlab"]:
        monkeypatch.delitem(sys.modules, loaded)
    for swapped in SWAPPED:
        monkeypatch.setitem(sys.modules, f"mjlab.{swapped}", importlib.import_module(f"mjsense.compat.mjlab.{swapped}"))
    monkeypatch.setattr(sys, "meta_path", [_Finder(root), *sys.meta_path])
    try:
        return importlib.import_module(f"mjlab.{name}")
    finally:
        for loaded in [m for m in sys.modules if m.partition(".")[0] == "mjlab"]:
            if loaded.removeprefix("mjlab.") not in SWAPPED:
                del sys.modules[loaded]
