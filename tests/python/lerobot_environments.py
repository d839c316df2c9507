# SPDX-License-Identifier: Apache-2.0
"""Environments of their own with LeRobot, build/lerobot_VERSION.

MJSENSE_TEST_LEROBOT=1 makes them: 8 GB for 0.4.4 and 0.3.3, which share one, 5 GB for 0.6.1, which needs Python 3.12.
"""

import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build"


def run_pip(python, *words):
    pip = [python, "-I", "-m", "pip", "install", "--quiet", "--no-compile", "--disable-pip-version-check", "--retries=1", *words]
    done = subprocess.run(pip, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"pip cannot install {' '.join(map(str, words))}: {done.stderr.strip()[-300:]}")


def python_312():
    """A Python of at least 3.12, or None."""
    pyenv = sorted(glob.glob(os.path.expanduser("~/.pyenv/versions/3.12*/bin/python")))
    for name in [sys.executable, *filter(None, [shutil.which("python3.12")]), *pyenv]:
        code = "import sys; sys.exit(sys.version_info < (3, 12))"
        if subprocess.run([name, "-c", code], capture_output=True).returncode == 0:
            return name
    return None


def environment(version):
    """The Python of LeRobot's environment, and its PYTHONPATH."""
    folder = BUILD / f"lerobot_{version}"
    if version == "0.3.3":  # only this version and the datasets library that it needs; the rest is that of 0.4.4
        python, _ = environment("0.4.4")
        packages = ["--no-deps", "--target", folder, "lerobot==0.3.3", "datasets==3.6.0"]
    else:
        python = folder / "bin/python"
        packages = ["lerobot==0.4.4"] if version == "0.4.4" else [f"lerobot[dataset]=={version}"]
    if not (folder / "installed").exists():
        if os.environ.get("MJSENSE_TEST_LEROBOT", "0") == "0":
            pytest.skip(f"needs {folder}; make it: MJSENSE_TEST_LEROBOT=1 ./dev test -k test_lerobot")
        if version != "0.3.3":
            base = sys.executable if version == "0.4.4" else python_312()
            if base is None:
                pytest.skip(f"LeRobot {version} needs Python 3.12")
            subprocess.run([base, "-m", "venv", folder], check=True)
        run_pip(python, *packages)
        (folder / "installed").touch()
    return python, str(folder) if version == "0.3.3" else ""


def checkers():
    """The Python of LeRobot 0.4.4's environment, the programs on PyPI that check LeRobot data sets, and the variables with which they run."""
    python, _ = environment("0.4.4")
    folder = BUILD / "lerobot_checkers"
    if not (folder / "installed").exists():
        if os.environ.get("MJSENSE_TEST_LEROBOT", "0") == "0":
            pytest.skip(f"needs {folder}; make it: MJSENSE_TEST_LEROBOT=1 ./dev test -k test_lerobot")
        run_pip(python, "--no-deps", "--target", folder, "lerobot-doctor==0.2.0", "lerobot-lint==0.1.1", "lerobot-quality-gates==0.1.7",
                "typer", "click", "shellingham", "annotated-doc", "rich", "markdown-it-py", "mdurl", "pygments")  # fmt: skip
        (folder / "installed").touch()
    return python, folder / "bin", {"PYTHONPATH": str(folder), "HF_HUB_OFFLINE": "1", "HF_HOME": str(folder / "hf"), "COLUMNS": "400"}


def with_mjsense(version):
    """The Python of LeRobot's environment, and the variables with which it finds mjsense and lerobot_env_mjsense too."""
    if os.environ.get("MJSENSE_TEST_LEROBOT", "0") == "0":
        pytest.skip("takes minutes; run it with MJSENSE_TEST_LEROBOT=1 ./dev test -k test_lerobot")
    python, _ = environment(version)
    folder = BUILD / f"lerobot_{version}_mjsense"
    if not (folder / "installed").exists():
        run_pip(python, "--no-deps", "--target", folder, "nanobind-backend", "mujoco-core", "h5py", "msgpack", "websockets")
        (folder / "installed").touch()
    plugin = ROOT / "packaging/lerobot_env_mjsense"
    run_pip(python, "--no-deps", "--upgrade", "--target", folder / "plugin", plugin)
    import mjsense

    places = (Path(mjsense.__file__).parents[1], folder, folder / "plugin")
    return python, {"PYTHONPATH": os.pathsep.join(map(str, places)), "HF_HUB_OFFLINE": "1", "HF_HOME": str(folder / "hf")}
