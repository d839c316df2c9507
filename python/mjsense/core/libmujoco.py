# SPDX-License-Identifier: Apache-2.0
"""Chooses the libmujoco that the extension uses, and loads both.

The extension needs a library of the name libmj_mjsense.so. ``_lib`` contains two of them:

* ``_lib/libmj_mjsense.so`` is a complete copy of the libmujoco that the extension was compiled with. It is loaded unless the
  environment's ``mujoco`` is of the same series, so that any other version, or none, may be installed and imported before or
  after.
* ``_lib/shared/libmj_mjsense.so`` is empty. If the environment's ``mujoco`` is of the same series, it is loaded first, and the
  symbols of that libmujoco are made global: the dynamic linker takes the name as loaded and finds the functions in the global
  scope. The process then contains one libmujoco, and MjModel and MjData objects are shared by pointer.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import os
import re
import sys
from pathlib import Path
from types import ModuleType

SERIES = (4, 0)
"""Major and minor version of MuJoCo that this package is built for; struct layouts are equal within the series."""
REQUIREMENT = "mujoco>=4.0,<4.1"
_LIB = Path(__file__).parents[1] / "_lib"

shared: ModuleType | None = None
"""The environment's ``mujoco`` if the extension uses its libmujoco; None if the extension uses its own copy."""
why_not_shared = ""
"""Why the extension uses its own copy."""


def installed() -> str:
    """Versions of the installed MuJoCo packages according to their metadata."""
    import importlib.metadata  # slow to import, and needed for errors only

    found = []
    for name in ("mujoco-core", "mujoco"):
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return ", ".join(found) or "neither mujoco-core nor mujoco"


def _error(problem: str, mend: str) -> ImportError:
    return ImportError(f"mjsense cannot be loaded: {problem}; installed: {installed()}. Repair it with: {mend}")


def _series(version: str) -> tuple[int, ...]:
    return tuple(int(n) for n in re.findall(r"\d+", version)[:2])


def _libraries(folders: list[str]) -> list[Path]:
    return sorted(file for folder in folders for file in Path(folder).glob("libmujoco.so.*"))


def _environment() -> tuple[ModuleType, Path]:
    """The environment's mujoco and its libmujoco; raises LookupError with the reason if they cannot be shared."""
    if os.environ.get("MJSENSE_MUJOCO") == "private":
        raise LookupError("the environment variable MJSENSE_MUJOCO is 'private'")
    if "mujoco" not in sys.modules:
        spec = importlib.util.find_spec("mujoco")
        if spec is None:
            raise LookupError("no package mujoco is installed")
        # The file's name tells the version without the time of an import. After broken installations there may be several.
        folders = list(spec.submodule_search_locations or ())
        versions = {file.name.removeprefix("libmujoco.so.") for file in _libraries(folders)}
        if len(versions) == 1 and _series(version := versions.pop()) != SERIES:
            raise LookupError(f"the installed mujoco is {version}")
    try:
        mujoco = importlib.import_module("mujoco")
        version = mujoco.mj_versionString()
    except Exception as error:  # whatever is wrong with it, mjsense does not need it
        raise LookupError(f"`import mujoco` failed: {error}") from error
    if _series(version) != SERIES:
        raise LookupError(f"the installed mujoco is {version}")
    # Installing over an older version can leave several files. The bindings have loaded the one of their version.
    libraries = [file for file in _libraries(list(mujoco.__path__)) if file.name == f"libmujoco.so.{version}"]
    if not libraries:
        raise LookupError(f"mujoco {version} has no libmujoco.so.{version} in {', '.join(mujoco.__path__)}")
    return mujoco, libraries[0]


def load() -> None:
    """Loads the extension with the libmujoco that it uses; raises ImportError."""
    global shared, why_not_shared
    flags = os.RTLD_NOW | os.RTLD_LOCAL
    try:
        shared, library = _environment()
        ctypes.CDLL(os.fspath(library), mode=ctypes.RTLD_GLOBAL)
        ctypes.CDLL(os.fspath(_LIB / "shared" / "libmj_mjsense.so"))
    except (LookupError, OSError) as error:
        shared, why_not_shared = None, str(error)
        # The linker looks for symbols in the global scope first. No package puts a libmujoco there, but a program may be linked
        # with one, or load `mujoco` with RTLD_GLOBAL. Only then is the order reversed: RTLD_DEEPBIND also bypasses a preloaded
        # malloc.
        if hasattr(ctypes.CDLL(None), "mj_version"):
            flags |= os.RTLD_DEEPBIND
    before = sys.getdlopenflags()
    sys.setdlopenflags(flags)
    try:
        core = importlib.import_module("mjsense._core")
        if shared is None:
            for plugin in sorted((_LIB / "plugin").glob("*.so")):
                ctypes.CDLL(os.fspath(plugin), mode=flags)
    except (ImportError, OSError) as error:
        raise _error(str(error), "pip install --force-reinstall mjsense") from error
    finally:
        sys.setdlopenflags(before)
    check(core)


def check(core: ModuleType) -> None:
    """Raises ImportError unless the extension uses the chosen libmujoco, with the struct layouts it was compiled for."""
    n = core.mujoco_headers
    built = f"{n // 1000000}.{n // 1000 % 1000}.{n % 1000}"
    expected = shared.mj_versionString() if shared else built
    packages = f"mujoco=={built} mujoco-core=={built}" if shared else "mjsense"
    reinstall = f"pip install --force-reinstall --no-deps {packages}"
    if core.mujoco_version() != expected:
        raise _error(f"the process contains another libmujoco, {core.mujoco_version()}, instead of {expected}", reinstall)
    if difference := core.mujoco_layout_difference():
        raise _error(f"MuJoCo {expected} is not laid out as the {built} that mjsense was compiled with: {difference}", reinstall)


def explain() -> str:
    """Why MuJoCo's own functions cannot take objects of mjsense, and what to install."""
    built = ".".join(map(str, SERIES))
    return (
        f"mjsense uses its own libmujoco {built} because {why_not_shared}; pip install '{REQUIREMENT}' to share "
        "objects with mujoco"
    )
