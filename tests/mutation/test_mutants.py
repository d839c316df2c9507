# SPDX-License-Identifier: Apache-2.0
"""Every mutant applies to the code as it stands: whoever moves its text moves it here too."""

import importlib.util
import sys
from pathlib import Path

import pytest

# Under a name of its own: tests/conformance has a run.py too.
spec = importlib.util.spec_from_file_location("mutation_run", Path(__file__).parent / "run.py")
mutation = sys.modules["mutation_run"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(mutation)
Failure, Mutant, check, load = mutation.Failure, mutation.Mutant, mutation.check, mutation.load


def test_every_mutant_applies():
    assert check(load()) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "found"),
    [
        ("src/mjsense/core/nowhere.cc", "x", "y", "there is no src/mjsense/core/nowhere.cc"),
        ("src/mjsense/core/png.cc", "what stands nowhere", "y", "its text stands 0 times"),
        ("src/mjsense/core/png.cc", "mjsense", "y", "times in src/mjsense/core/png.cc, expected once"),
        ("src/mjsense/core/png.cc", "namespace mjsense {", "namespace mjsense {", "changes nothing"),
        ("tests/golden/golden_test.cc", "x", "y", "in no room"),
    ],
)
def test_mutant_that_does_not_apply_is_named(file, old, new, found):
    (error,) = check([Mutant("odd-one", file, "odd", old, new)])
    assert error.startswith("odd-one: ") and found in error


def test_duplicate_ids_are_rejected(tmp_path):
    text = (Path(__file__).parent / "mutants.toml").read_text()
    twice = tmp_path / "mutants.toml"
    twice.write_text(text + text[text.index("[[mutant]]") : text.index("[[mutant]]", 40 + text.index("[[mutant]]"))])
    with pytest.raises(Failure, match="two mutants have this id"):
        load(twice)
