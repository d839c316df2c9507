# SPDX-License-Identifier: Apache-2.0
import os
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def record_fake():
    """Runs the program that records a suite without physics: record_fake(out, "--episodes", 4) -> CompletedProcess."""
    program = Path(os.environ.get("MJSENSE_RECORD_FAKE", ROOT / "build/dev/record_fake"))
    if not program.exists():
        pytest.skip("record_fake is not built (./dev build)")

    def run(*arguments, check=True):
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=120)
        if check:
            assert done.returncode == 0, done.stderr
        return done

    vars(run).update(program=program)
    return run
