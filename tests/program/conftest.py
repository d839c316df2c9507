# SPDX-License-Identifier: Apache-2.0
"""Fixture that runs the mjsense program: `python -m mjsense`, or the words of $MJSENSE_PROGRAM."""

import os
import shlex
import subprocess
import sys

import pytest

PROGRAM = shlex.split(os.environ.get("MJSENSE_PROGRAM", "")) or [sys.executable, "-m", "mjsense"]


@pytest.fixture
def mjsense(tmp_path):
    """mjsense("record", "pick", ..., rc=0) runs the program in an empty folder, checks the exit code and returns the finished
    process."""

    def run(*args, rc=0, env=None, **kwargs):
        done = subprocess.run(
            [*PROGRAM, *map(str, args)],
            cwd=tmp_path, env={**os.environ, **(env or {})}, capture_output=True, text=True, timeout=300, **kwargs)
        assert done.returncode == rc, f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done

    vars(run).update(program=PROGRAM, folder=tmp_path)
    return run
