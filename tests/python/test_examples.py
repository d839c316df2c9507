# SPDX-License-Identifier: Apache-2.0
"""Every example runs and prints what is expected."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_installed import PUBLIC

import mjsense

EXAMPLES = Path(__file__).parents[2] / "examples"
BUILD = Path(mjsense.__file__).absolute().parents[2]
SAYS = {"01": "landed: [9.81 9.81 9.81 9.81]", "02": "picture: (3, 48, 64, 3) uint8", "03": "the planner picked 2 of 2",
        "04": "the feet press on the floor with 88", "05": "pixels of the box: [1916 1234  826]", "06": "of 4 unseen episodes",
        "07": "trained: "}
SHORT = {"06": ("--recorded", "4", "--judged", "4", "--passes", "1"), "07": ("--episodes", "2", "--steps", "2", "--judged", "2")}  # arguments that make it quick

COMMANDS = {
    "06": "ClonePolicy|clone/trained|--policy-option|net=clone/network.pt|--scene|table|--horizon|150|--episodes|4|--worlds|4",
    "07": "Follower|pictures/trained|--policy-option|network=pictures/network.pt|--robot|franka|--width|128|--height|96|--camera-system|close_up"
          "|--arm-controller|{ kind = 'ee_delta_pose', frame = 'tool', reference = 'measured', max_translation = 0.15, max_rotation = 1.0 }"
          "|--horizon|120|--instructions|canonical|--no-terminate-upon-success|--episodes|2|--worlds|2",
}  # fmt: skip
"""How `mjsense evaluate` evaluates the network of an example: class, folder of the example's own results, options."""


@pytest.mark.parametrize("name", sorted(p.name for p in EXAMPLES.glob("*.py")))
def test_example(name, tmp_path):
    if "import torch" in (EXAMPLES / name).read_text():
        pytest.importorskip("torch")
    path = os.pathsep.join([str(Path(mjsense.__file__).absolute().parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    env = {**os.environ, "PYTHONPATH": path, "TMPDIR": str(tmp_path)}

    def run(*words):
        done = subprocess.run([sys.executable, *map(str, words)], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert SAYS.get(name[:2], "") in run(EXAMPLES / name, *SHORT.get(name[:2], ()))
    if name[:2] in COMMANDS:  # the same episodes with the same outcomes
        policy, folder, *words = COMMANDS[name[:2]].split("|")
        run("-m", "mjsense", "evaluate", "pick", "--policy", f"{EXAMPLES / name}:{policy}", "--seed", "10000", "--out", "again", *words)
        mine, again = (mjsense.Dataset(tmp_path / out).episodes for out in (folder, "again"))
        for one, other in zip(mine, again, strict=True):
            assert (other.number, other.success, other.task) == (one.number, one.success, one.task)
            np.testing.assert_array_equal(other.states, one.states)


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
    assert printed.startswith("2 episodes, ") and "intact: 1 file, 2 episodes" in printed
    assert len(list((tmp_path / "recording/house_0").glob("*.h5"))) == 1
