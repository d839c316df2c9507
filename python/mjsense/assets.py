# SPDX-License-Identifier: Apache-2.0
"""Meshes that other installed packages bring. Robots are drawn with shapes of our own without them; motion is the same."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

_PACKAGE = "package:"


def installed_meshes(robots: Iterable[str]) -> dict[str, Path]:
    """Folders of meshes by the environment variable that names them, of robots given by the texts of their files. Imports nothing."""
    import tomllib  # slow to import

    found = {}
    for text in robots:
        meshes = tomllib.loads(text).get("meshes", {})
        if "env" not in meshes or not meshes.get("folder", "").startswith(_PACKAGE):
            continue
        package, _, inside = meshes["folder"].removeprefix(_PACKAGE).partition("/")
        spec = importlib.util.find_spec(package)
        for root in (spec.submodule_search_locations or ()) if spec else ():
            folder = Path(root, inside)
            if all((folder / file).is_file() for file in meshes.get("files", {}).values()):
                found[meshes["env"]] = folder
    return found


def use_installed_meshes() -> None:
    """Draws robots with the meshes there are, for tasks made from now on. A variable that is set, even if empty, has priority."""
    from mjsense import _core

    for variable, folder in installed_meshes(map(_core.robot_text, _core.robot_names())).items():
        os.environ.setdefault(variable, str(folder))


def name_package_folders() -> None:
    """Tells the library where installed packages are, for scenes that name files of them. A variable that is set has priority."""
    folders = dict.fromkeys(path for path in sys.path if Path(path).name in ("site-packages", "dist-packages"))
    os.environ.setdefault("MJSENSE_PACKAGES", os.pathsep.join(folders))


if __name__ == "__main__":  # as lines for a shell, of the robots in a folder
    for variable, folder in installed_meshes(p.read_text() for p in Path(sys.argv[1]).glob("*/robot.toml")).items():
        print(f"export {variable}=${{{variable}-{folder}}}")
