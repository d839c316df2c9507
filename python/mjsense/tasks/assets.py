# SPDX-License-Identifier: Apache-2.0
"""Files of other installed packages: meshes of robots, and objects for scenes. Without them, robots are drawn with built-in
primitive shapes; their motion is the same."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

_PACKAGE = "package:"
_GENERATORS = {"scene_synthesizer": "mjsense.tasks.synthesized_objects"}
"""Modules that write the files of a source's objects with its packages."""


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


def use_installed_files(words: list[str]) -> None:
    """Makes the C++ program, run with these arguments in this process, use the meshes and the ffmpeg of installed packages."""
    from mjsense.recording.ffmpeg import use_installed_ffmpeg  # this file also runs alone

    if "--meshes=real" in words or ("--meshes", "real") in pairwise(words):
        use_installed_meshes()
    use_installed_ffmpeg()


def name_package_folders() -> None:
    """Tells the library the folders of installed packages, for scenes that refer to their files. A variable that is set has
    priority."""
    folders = dict.fromkeys(path for path in sys.path if Path(path).name in ("site-packages", "dist-packages"))
    os.environ.setdefault("MJSENSE_PACKAGES", os.pathsep.join(folders))


def _objects() -> list[dict[str, Any]]:
    from mjsense import _core

    name_package_folders()
    return json.loads(_core.objects_json())


def _run(source: str, command: list[str], **options: Any) -> None:
    if subprocess.run(command, stdout=sys.stderr, check=False, **options).returncode != 0:
        raise RuntimeError(f"{source}: this command failed: {' '.join(command)}")


def _pip_install(source: str, *arguments: str) -> None:
    _run(source, [sys.executable, "-m", "pip", "install", "--no-deps", "--quiet", *arguments])


def _wheel(files: Path, version: str) -> Path:
    """A wheel, in the parent folder, that installs a folder of files as a package with its name. pip can uninstall it."""
    name = files.name
    wheel = files.with_name(f"{name}-{version}-py3-none-any.whl")
    about = f"{name}-{version}.dist-info"
    contents = {f"{name}/{file.name}": file.read_text() for file in sorted(files.iterdir())}
    contents[f"{about}/METADATA"] = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    contents[f"{about}/WHEEL"] = "Wheel-Version: 1.0\nGenerator: mjsense\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    contents[f"{about}/RECORD"] = "".join(f"{file},,\n" for file in [*contents, f"{about}/RECORD"])
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, text in contents.items():
            archive.writestr(file, text)
    return wheel


def _install_generated(source: str, packages: list[str]) -> None:
    """Installs the files that a generator writes. The packages that it needs are only in a temporary folder."""
    with tempfile.TemporaryDirectory() as scratch:
        needed, files = Path(scratch, "needed"), Path(scratch, f"mjsense_{source}")
        _pip_install(source, "--target", str(needed), *packages)
        paths = os.pathsep.join(filter(None, [str(needed), os.environ.get("PYTHONPATH")]))
        _run(source, [sys.executable, "-m", _GENERATORS[source], str(files)], env=os.environ | {"PYTHONPATH": paths})
        _pip_install(source, "--force-reinstall", str(_wheel(files, packages[0].partition("==")[2])))


def install_objects(source: str) -> list[str]:
    """Installs the packages of a source of objects with pip, without their dependencies: only their files are used. Of a source whose
    objects are generated, only the generated files are installed.

    Returns:
        Names of the objects that were not installed before.

    Raises:
        ValueError: if there is no such source.
        RuntimeError: if pip or the generator fails, or the packages do not have the expected files.
    """
    listed = [one for one in _objects() if one["packages"]]
    objects = [one for one in listed if one["source"] == source]
    if not objects:
        known = ", ".join(dict.fromkeys(one["source"] for one in listed))
        raise ValueError(f"no package of objects is named '{source}'; available: {known}")
    missing = [one["name"] for one in objects if not one["installed"]]
    if not missing:
        return []
    if source in _GENERATORS:
        _install_generated(source, objects[0]["packages"])
    else:
        _pip_install(source, *objects[0]["packages"])
    left = [one["name"] for one in _objects() if one["source"] == source and not one["installed"]]
    if left:
        raise RuntimeError(f"{source}: the installed packages have no files of {', '.join(left)}")
    return missing


if __name__ == "__main__":  # Prints lines for a shell, for the robots in a folder.
    for variable, folder in installed_meshes(p.read_text() for p in Path(sys.argv[1]).glob("*/robot.toml")).items():
        print(f"export {variable}=${{{variable}-{folder}}}")
