"""Every example runs, and says what it should."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense

EXAMPLES = Path(__file__).parents[2] / "examples"
SAYS = {"01": "landed: [9.81 9.81 9.81 9.81]", "02": "picture: (3, 48, 64, 3) uint8", "03": "the planner picked 2 of 2",
        "04": "the feet press on the floor with 88"}


@pytest.mark.parametrize("name", sorted(p.name for p in EXAMPLES.glob("*.py")))
def test_example(name, tmp_path):
    env = {**os.environ, "PYTHONPATH": str(Path(mjsense.__file__).absolute().parents[1])}
    done = subprocess.run(
        [sys.executable, EXAMPLES / name], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert SAYS.get(name[:2], "") in done.stdout
