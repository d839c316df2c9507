# SPDX-License-Identifier: Apache-2.0
import importlib.util
import os
from collections import Counter
from pathlib import Path

import pytest

# Before the first `import mujoco`: mujoco.Renderer is the reference of some tests, and there is no display.
os.environ.setdefault("MUJOCO_GL", "egl")
# Tests run programs in other directories.
if path := os.environ.get("PYTHONPATH"):
    os.environ["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, path.split(os.pathsep)))
# Debian's ffmpeg, which the C++ tests use, loads 215 libraries at each start (0.125 s of CPU time); this one none (0.012 s).
if package := importlib.util.find_spec("imageio_ffmpeg"):
    for program in Path(package.origin).parent.glob("binaries/ffmpeg-*"):
        os.environ.setdefault("MJSENSE_FFMPEG", str(program))


def pytest_configure() -> None:
    """Refuses two modules of the same name: pytest puts the folder of each test file on sys.path, so that the first one imported would be found for both."""
    names = Counter(path.name for path in Path(__file__).parent.rglob("*.py") if path.name not in ("conftest.py", "run.py"))
    if repeated := [name for name, count in names.items() if count > 1]:
        raise pytest.UsageError(
            f"two files under tests/ are called {', '.join(sorted(repeated))}; a test would import the wrong one"
        )
