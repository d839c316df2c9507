# SPDX-License-Identifier: Apache-2.0
"""Finds and checks the libmujoco that ``import mujoco`` loads, and makes its symbols visible to the extension.

The extension is not linked to a file name, so it works with every MuJoCo of the supported series, and a process contains only one
libmujoco.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
from pathlib import Path
from types import ModuleType

SERIES = (4, 0)
"""Major and minor version of MuJoCo that this package is built for; struct layouts are equal within the series."""
REQUIREMENT = "mujoco-core>=4.0,<4.1"


def _installed(name: str) -> str | None:
    """The installed version according to the package metadata."""
    import importlib.metadata  # slow to import, and needed for errors only

    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _error(found: str) -> ImportError:
    core, whole = _installed("mujoco-core"), _installed("mujoco")
    have = ", ".join(f"{name} {version}" for name, version in (("mujoco-core", core), ("mujoco", whole)) if version)
    install = f"pip install '{REQUIREMENT}'"
    again = "pip install --force-reinstall --no-deps"
    if whole is None:
        mend = f"{again} '{REQUIREMENT}'" if core else install
    elif whole.split(".")[:2] == [str(n) for n in SERIES]:
        mend = f"{again} 'mujoco-core=={whole}'"  # the mujoco package requires mujoco-core of exactly the same version
    else:
        mend = f"pip uninstall -y mujoco && {again if core else 'pip install'} '{REQUIREMENT}'"
    return ImportError(
        f"mjsense needs MuJoCo {SERIES[0]}.{SERIES[1]} ({REQUIREMENT}); {found}; "
        f"installed: {have or 'neither mujoco-core nor mujoco'}. Mend it with: {mend}"
    )


def _libraries(mujoco: ModuleType) -> list[Path]:
    return sorted(
        file for folder in mujoco.__path__ for pattern in ("libmujoco.so*", "libmujoco*.dylib") for file in Path(folder).glob(pattern)
    )


def load() -> None:
    """Imports mujoco and makes its libmujoco's symbols visible to the extension; raises ImportError for another series."""
    if importlib.util.find_spec("mujoco") is None:
        raise _error("found no package mujoco")
    try:
        import mujoco

        version = mujoco.mj_versionString()
    except (ImportError, AttributeError) as error:
        raise _error(f"`import mujoco` failed: {error}") from error
    if tuple(int(n) for n in version.split(".")[:2]) != SERIES:
        raise _error(f"found {version} in {Path(mujoco.__file__ or '').parent}")
    libraries = _libraries(mujoco)
    # Installing over an older version can leave several files. The bindings have loaded the one of their version.
    chosen = [file for file in libraries if version in file.name] or libraries
    if not chosen:
        raise _error(f"found {version}, but no libmujoco in {', '.join(mujoco.__path__)}")
    ctypes.CDLL(os.fspath(chosen[0]), mode=ctypes.RTLD_GLOBAL)


def check(core: ModuleType) -> None:
    """Raises ImportError unless the extension uses the libmujoco of `mujoco` with the struct layouts it was compiled for."""
    import mujoco

    if core.mujoco_version() != mujoco.mj_versionString():
        raise _error(f"another libmujoco, {core.mujoco_version()}, was loaded into this process before mujoco's {mujoco.mj_versionString()}")
    if difference := core.mujoco_layout_difference():
        built = f"{core.mujoco_headers // 1000000}.{core.mujoco_headers // 1000 % 1000}.{core.mujoco_headers % 1000}"
        raise _error(f"{core.mujoco_version()} is not laid out as the {built} that mjsense was compiled with: {difference}")
