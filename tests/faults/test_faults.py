# SPDX-License-Identifier: Apache-2.0
"""The short form of tests/faults/run.py: every kind of fault with few trials."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import crafted
import faults

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    program = Path(os.environ.get("MJSENSE_RECORD_FAKE", ROOT / "build/dev/record_fake"))
    if not program.exists():
        pytest.skip("record_fake is not built (./dev build)")
    return faults.Lab(program, tmp_path_factory.mktemp("faults"))


def can_mount():
    return shutil.which("unshare") and subprocess.run(["unshare", "-m", "true"], capture_output=True).returncode == 0


def check(row):
    assert row.clean, "\n".join(row.notes)


# Without the slow cases, which read files of many megabytes and run only in the long form.
QUICK = sorted(set(crafted.CASES) - {"gzip_bomb", "json_bomb", "deep_groups", "many_large_pictures"})


@pytest.mark.parametrize("part", range(4))
def test_crafted_files(lab, part):
    check(faults.hostile(lab, QUICK[part::4][::3]))


def test_bombs(lab):
    check(faults.hostile(lab, ["gzip_bomb", "deep_groups"]))


def test_flipped_bits(lab):
    check(faults.flips(lab, 30))


def test_truncated_files(lab):
    check(faults.truncations(lab, 20))


def test_mutated_files(lab):
    check(faults.mutations(lab, 30))


def test_damage_to_an_unfinished_recording(lab):
    check(faults.staged(lab))


def test_faulty_and_hanging_encoders(lab):
    check(faults.encoders(lab))


@pytest.mark.skipif(not can_mount(), reason="a small disk needs the right to mount one")
def test_full_disks(lab):
    check(faults.full_disks(lab, 6))
    check(faults.full_disk_repairs(lab, 4))


def test_kills_before_changes_of_the_file_system(lab):
    check(faults.killed_changes(lab, 24))


def test_limits_on_the_size_of_files(lab):
    check(faults.file_limits(lab, 12))


@pytest.mark.parametrize("trials", ["generated=8", "crafted_readers=4"])
def test_readers_of_the_package(trials):
    # A process of its own, because the trials fork, which needs a process without threads.
    done = subprocess.run([sys.executable, ROOT / "tests/faults/run.py", "--no-table", trials], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
