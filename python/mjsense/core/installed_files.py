# SPDX-License-Identifier: Apache-2.0
"""Files of installed packages: meshes of robots, and folders that scenes refer to. Without meshes, robots are drawn with built-in
primitive shapes; their motion is the same."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

_PACKAGE = "package:"


def installed_meshes(robots: Iterable[str]) -> dict[str, Path]:
    """Folders of meshes by the name of their environment variable, for robots given by the texts of their files. Imports no
    package."""
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
    """Makes tasks created from now on draw robots with the installed meshes. An environment variable that is set, even if empty,
    has priority."""
    from mjsense import _core

    for variable, folder in installed_meshes(map(_core.robot_text, _core.robot_names())).items():
        os.environ.setdefault(variable, str(folder))


def name_package_folders() -> None:
    """Tells the library the folders of installed packages, for scenes that refer to their files. A variable that is set has
    priority."""
    folders = dict.fromkeys(path for path in sys.path if Path(path).name in ("site-packages", "dist-packages"))
    os.environ.setdefault("MJSENSE_PACKAGES", os.pathsep.join(folders))


if __name__ == "__main__":  # Prints lines for a shell, for the robots in a folder.
    for variable, folder in installed_meshes(p.read_text() for p in Path(sys.argv[1]).glob("*/robot.toml")).items():
        print(f"export {variable}=${{{variable}-{folder}}}")
