# SPDX-License-Identifier: Apache-2.0
"""With other versions of MuJoCo, in environments that are made when they are first needed (build/mujoco_VERSION) and kept.

MJSENSE_TEST_MUJOCO chooses the versions: "3.8.1,3.17.0" by default, "all", or any list. "none" is an environment without mujoco, and "3.17.0+4.0"
one in which the files of mujoco-core 4.0 lie over those of mujoco 3.17.0, so that `import mujoco` fails.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense

ROOT = Path(__file__).parents[2]
ALL = ("3.3.0", "3.3.7", "3.8.1", "3.11.0", "3.17.0", "4.0.0", "none", "3.17.0+4.0")
chosen = os.environ.get("MJSENSE_TEST_MUJOCO", "3.8.1,3.17.0,none")
VERSIONS = ALL if chosen == "all" else chosen.split(",")
SCRIPT = Path(__file__).with_name("other_mujoco.py")


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """What is printed in the environment of the tests, which shares its libmujoco."""
    return run(sys.executable, "mujoco-first", tmp_path_factory.mktemp("here") / "out")


def run(python, order, folder):
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run([python, "-W", "ignore", SCRIPT, order, folder], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines()[-1]


def environment(version):
    """The Python of an environment with this mujoco; the test is skipped if it cannot be made."""
    folder = ROOT / f"build/mujoco_{version}"
    python = folder / "bin/python"
    if (folder / "complete").exists():
        return python
    first, _, over = version.partition("+")
    mujoco = [] if version == "none" else [f"mujoco=={first}"]
    steps = [["gymnasium>=1.1", "nanobind-backend>=1.0", "numpy>=1.26", "pytest", "PyOpenGL", *mujoco]]
    steps += [["--no-deps", f"mujoco-core=={over}.*"]] if over else []
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    for step in steps:
        pip = [python, "-I", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:", "--retries=1", *step]
        done = subprocess.run(pip, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"pip cannot install {' '.join(step)}: {done.stderr.strip()[-300:]}")
    if not over:
        subprocess.run([python, "-I", "-m", "pip", "check", "--disable-pip-version-check"], check=True)
    (folder / "complete").touch()
    return python


@pytest.mark.parametrize("order", ["mujoco-first", "mjsense-first", "alone"])
@pytest.mark.parametrize("version", VERSIONS)
def test_everything_works_and_equals_what_is_computed_here(version, order, here, tmp_path):
    if order != "alone" and (version == "none" or "+" in version):
        pytest.skip("mujoco cannot be imported there")
    found = run(environment(version), order, tmp_path / "out")
    if not version.startswith("4."):  # which is used itself, and need not compute the same
        assert found == here


@pytest.mark.parametrize("version", [v for v in VERSIONS if v != "none" and "+" not in v])
def test_attached_sensors_measure_what_that_mujoco_computes(version):
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = [environment(version), "-W", "ignore", Path(__file__).with_name("attach_other_mujoco.py")]
    done = subprocess.run(run, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]


@pytest.mark.parametrize("version", [version for version in VERSIONS if version != "none" and "+" not in version])
def test_images_are_those_of_its_renderer(version):
    python = environment(version)
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    if subprocess.run([python, "-c", "import OpenGL, pytest"], capture_output=True).returncode:
        pytest.skip(f"{python.parents[1]} is older than this test; delete it")
    command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "look_as_in_opengl", SCRIPT.with_name("test_renderer_opengl.py")]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stdout[-3000:]
