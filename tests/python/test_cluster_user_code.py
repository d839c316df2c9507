# SPDX-License-Identifier: Apache-2.0
"""Python code of a user on the workers of a Ray cluster, with a package that only they have.

Ray copies the environment in which it is installed for this, so the test has a small one of its own, build/ray_user;
MJSENSE_TEST_RAY_USER=1 makes it. The workers install a package from the index.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense as mjs

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build/ray_user"
PACKAGES = ["ray>=2.40", "virtualenv", "fsspec", "pyarrow", "h5py", "numpy", "gymnasium", "nanobind-backend"]
SENSOR = '\n[[sensors]]\nkind = "python"\nname = "of_robot"\nclass = "lab:Length"\nargs = { name = "of_robot" }\n'


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs record.py in a folder with the user's code, and returns its last line."""
    if not (FOLDER / "complete").exists():
        if os.environ.get("MJSENSE_TEST_RAY_USER", "0") == "0":
            pytest.skip("needs build/ray_user; make it: MJSENSE_TEST_RAY_USER=1 ./dev test -k test_cluster_user_code")
        subprocess.run([sys.executable, "-m", "venv", FOLDER], check=True)
        done = subprocess.run([FOLDER / "bin/python", "-I", "-m", "pip", "install", "--quiet", "--retries=1", *PACKAGES], capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"pip cannot install {' '.join(PACKAGES)}: {done.stderr.strip()[-300:]}")
        (FOLDER / "complete").touch()
    (packages,) = FOLDER.glob("lib/python*/site-packages")
    (packages / "mjsense.pth").write_text(str(Path(mjs.__file__).parents[1]))  # as if it were installed
    folder, given = tmp_path_factory.mktemp("user"), Path(__file__).parent / "cluster_user_code"
    shutil.copytree(ROOT / "models/robots/franka", folder / "lab_franka")
    with open(folder / "lab_franka/robot.toml", "a") as file:
        file.write(SENSOR)
    shutil.copytree(given / "code", folder / "code")  # Ray finds modules in the driver's own folder without help
    shutil.copytree(folder / "lab_franka", folder / "code/lab_franka")

    def call(out, environment):
        without = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run([FOLDER / "bin/python", given / "record.py", out, json.dumps(environment)], cwd=folder, capture_output=True, text=True,
                              env=without, timeout=500)  # fmt: skip
        return (done.stdout.strip() or done.stderr).splitlines()[-1]

    return call


def test_workers_have_the_code_and_its_packages(run, tmp_path):
    assert run(tmp_path / "out", {"working_dir": "code", "pip": ["inflection==0.5.1"]}) == "[3.0] [3.0]"


@pytest.mark.parametrize(("environment", "message"), (
    ({}, "RuntimeError: The workers cannot load the arguments of the task run_shard: No module named 'lab'. Send its folder with working_dir"),
    ({"working_dir": "code"}, "No module named 'inflection'"),
    ({"working_dir": "code", "pip": ["inflection==77"]}, "RuntimeError: Ray cannot make the environment of the workers (runtime_env): ERROR: No matching "
                                                      "distribution found for inflection==77"),
    ({"working_dir": "nowhere"}, "nowhere"),
))  # fmt: skip
def test_an_environment_that_lacks_something_is_an_error(run, tmp_path, environment, message):
    assert message in run(tmp_path / "out", environment)
