# SPDX-License-Identifier: Apache-2.0
"""tests/emulated.txt names tests that exist; a wrong name would leave out, or run, nothing."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINES = [line.partition("#")[0].split() for line in (ROOT / "tests/emulated.txt").read_text().splitlines() if line and line[0] != "#"]


@pytest.mark.parametrize("line", LINES, ids=" ".join)
def test_named_tests_exist(line):
    if line[0] == "python":
        assert (ROOT / line[1]).is_file()
        return
    assert line[0] == "without"
    suite, name = line[2].split(".")
    suite, name = suite.split("/")[-1], name.split("/")[0]
    sources = "".join(path.read_text() for path in ROOT.glob(f"src/*/{line[1]}/**/*_test.cc"))
    assert re.search(rf"\bTEST(_F|_P)?\({suite}, {name}\)", sources)
