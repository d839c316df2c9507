# SPDX-License-Identifier: Apache-2.0
import pytest
from program_runs import PROGRAM, run_program


@pytest.fixture
def mjsense(tmp_path):
    """mjsense("record", "pick", ..., rc=0) runs the program in an empty folder, checks the exit code and returns the finished
    process."""

    def run(*args, rc=0, **kwargs):
        done = run_program(*args, cwd=tmp_path, **kwargs)
        assert done.returncode == rc, f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done

    vars(run).update(program=PROGRAM, folder=tmp_path)
    return run
