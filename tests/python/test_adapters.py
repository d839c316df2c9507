# SPDX-License-Identifier: Apache-2.0
"""mjsense.compat against the renderers of the packages themselves, each in a process of its own (adapters/).

The packages and the MuJoCo that they need are in an environment of their own, build/adapters. MJSENSE_TEST_ADAPTERS=1 makes it.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "mujoco==3.8.1",
    "gymnasium==1.4.0",
    "gymnasium-robotics==1.4.2",
    "dm_control==1.0.41",
    "gym-aloha==0.1.3",
    "metaworld==3.0.0",
    "robosuite==1.5.2",
    "h5py",
    "nanobind-backend>=1.0",
    "PyOpenGL",
)


@pytest.fixture(scope="module")
def python():
    """The Python of the environment; the tests are skipped if it is not there and not wanted, or cannot be made."""
    folder = ROOT / "build/adapters"
    if not (folder / "complete").exists():
        if os.environ.get("MJSENSE_TEST_ADAPTERS", "0") == "0":
            pytest.skip("needs build/adapters; make it: MJSENSE_TEST_ADAPTERS=1 ./dev test -k test_adapters")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        pip = [folder / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries=1", *PACKAGES]
        done = subprocess.run(pip, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"pip cannot install {' '.join(PACKAGES)}: {done.stderr.strip()[-300:]}")
        (folder / "complete").touch()
    return folder / "bin/python"


@pytest.mark.parametrize(
    "script", ["dm_control_images", "aloha_images", "gymnasium_images", "robosuite_images", "without_opengl"]
)
def test_images_are_those_of_the_package(python, script):
    run(python, script)


@pytest.mark.parametrize("script", ["attach_environments", "record_episodes"])
def test_sensors_and_recordings_of_the_packages(python, script):
    run(python, script)


def run(python, script):
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [python, "-W", "ignore", Path(__file__).parent / f"adapters/{script}.py"]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    if done.returncode == 77:
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
