# SPDX-License-Identifier: Apache-2.0
"""Every example runs and prints what is expected."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from test_installed import PUBLIC

import mjsense

EXAMPLES = Path(__file__).parents[2] / "examples"
BUILD = Path(mjsense.__file__).absolute().parents[2]
SAYS = {"01": "landed: [9.81 9.81 9.81 9.81]", "02": "picture: (3, 48, 64, 3) uint8", "03": "the planner picked 2 of 2",
        "04": "the feet press on the floor with 88", "05": "pixels of the box: [1916 1234  826]", "06": "of 4 unseen episodes: untrained",
        "07": "trained: "}
SHORT = {"06": ("4", "4", "1"), "07": ("--episodes", "2", "--steps", "2", "--judged", "2")}  # arguments that make it quick


@pytest.mark.parametrize("name", sorted(p.name for p in EXAMPLES.glob("*.py")))
def test_example(name, tmp_path):
    if "import torch" in (EXAMPLES / name).read_text():
        pytest.importorskip("torch")
    env = {**os.environ, "PYTHONPATH": str(Path(mjsense.__file__).absolute().parents[1]), "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *SHORT.get(name[:2], ())], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert SAYS.get(name[:2], "") in done.stdout


@pytest.mark.skipif(not (BUILD / "CMakeCache.txt").exists(), reason="not imported from a build folder")
def test_cpp_projects(tmp_path):
    """examples/cpp find the installed libraries and are built: one takes a picture, one records episodes."""

    def run(*command):
        env = {k: v for k, v in os.environ.items() if k != "LD_LIBRARY_PATH"}
        done = subprocess.run([str(c) for c in command], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("cmake", "--install", BUILD, "--prefix", "installed")
    headers = {str(h.relative_to(tmp_path / "installed/include")) for h in (tmp_path / "installed/include").rglob("*.h")}
    assert headers == set(PUBLIC)
    for name in ("sees", "records"):
        run("cmake", "-S", EXAMPLES / "cpp" / name, "-B", name, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}")
        run("cmake", "--build", name)
    assert "OMPL" not in (tmp_path / "sees/CMakeCache.txt").read_text(), "the first library needs OMPL"
    run("sees/sees", EXAMPLES.parent / "bench" / "gallery.xml", "front")
    header, pixels = (tmp_path / "front.ppm").read_bytes().split(b"255\n", 1)
    assert header == b"P6 320 240 " and len(pixels) == 3 * 320 * 240 and len(set(pixels)) > 100
    printed = run("records/records", "recording")
    assert printed.startswith("2 episodes, ") and "intact: 1 files, 2 episodes" in printed
    assert len(list((tmp_path / "recording/house_0").glob("*.h5"))) == 1
