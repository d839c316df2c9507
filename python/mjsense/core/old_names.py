# SPDX-License-Identifier: Apache-2.0
"""Old names of modules. They work for one version, with a warning that gives the new name."""

from __future__ import annotations

import importlib
import sys
import warnings
from types import ModuleType
from typing import Any

OLD_NAMES = {
    "mjsense.assets": "mjsense.tasks.assets",
    "mjsense.configs": "mjsense.sensors.configs",
    "mjsense.data": "mjsense.sensors.data",
    "mjsense.effects": "mjsense.sensors.effects",
    "mjsense.errors": "mjsense.core.errors",
    "mjsense.export": "mjsense.exporting",
    "mjsense.observations": "mjsense.sensors.observations",
    "mjsense.rl": "mjsense.tasks.rl",
    "mjsense.rl.rsl": "mjsense.tasks.rl.rsl",
    "mjsense.rl.sb3": "mjsense.tasks.rl.sb3",
    "mjsense.teleoperation": "mjsense.tasks.teleoperation",
}


class _OldModule(ModuleType):
    """Looks up every name in the new module, which is imported then."""

    def __init__(self, old: str, new: str) -> None:
        super().__init__(old, f"The old name of :mod:`{new}`.")
        self._new = new

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__all__":  # looked up in every module by tools that inspect them
            raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")
        warnings.warn(f"{self.__name__} is now {self._new}", DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(self._new), name)


def register() -> None:
    """Makes ``import`` find the old names. A public name of a package, such as ``mjsense.effects``, stays what it is."""
    for old, new in OLD_NAMES.items():
        module = sys.modules.setdefault(old, _OldModule(old, new))
        package, _, name = old.rpartition(".")
        vars(sys.modules[package]).setdefault(name, module)
