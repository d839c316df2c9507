# SPDX-License-Identifier: Apache-2.0
"""Tests with stdin, stdout and stderr closed or full, as with a daemon, a lost terminal or a full disk."""

import os
import subprocess

import pytest


def closing(*streams):
    def close():
        for fd in streams:
            os.close(fd)
    return close


def run(mjsense, *args, **kwargs):
    return subprocess.run([*mjsense.program, *map(str, args)], cwd=mjsense.folder, timeout=300, **kwargs).returncode


@pytest.mark.parametrize("streams", [(2,), (0, 2), (1, 2), (0, 1, 2)])
def test_exit_code_if_the_streams_are_closed(mjsense, streams):
    assert run(mjsense, "verify", "missing", preexec_fn=closing(*streams)) == 2


def test_recording_continues_if_messages_cannot_be_written(mjsense):
    """A recording continues if stderr is closed or full, and text for stderr is never written into its files."""
    with open("/dev/full", "w") as full:
        assert run(mjsense, "verify", "missing", stderr=full) == 2
        assert run(mjsense, "record", "pick", "--out", "full", "--cameras", "none", "--seed", "1", stderr=full, stdout=subprocess.DEVNULL) == 0
    assert run(mjsense, "record", "pick", "--out", "closed", "--cameras", "none", "--seed", "1", preexec_fn=closing(0, 2)) == 0
    name = "house_0/trajectories_batch_1_of_1.h5"
    assert (mjsense.folder / "closed" / name).read_bytes() == (mjsense.folder / "full" / name).read_bytes()
    for word in ("verify", "inspect"):
        assert run(mjsense, word, "closed", stdout=subprocess.DEVNULL, preexec_fn=closing(0, 2)) == 0
        assert run(mjsense, word, "closed", preexec_fn=closing(1)) == 2  # its result cannot be written
