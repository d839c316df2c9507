# SPDX-License-Identifier: Apache-2.0
"""Every sensor over models without geoms, bodies, joints, lights or sites works, or gives an error that names the sensor."""

import subprocess
import sys
from pathlib import Path


def test_no_sensor_fails_for_what_a_model_lacks():
    script = Path(__file__).with_name("poor_models.py")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=600)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, f"exit status {done.returncode} after: {lines[-2:]} {done.stderr[-500:]}"
    assert lines[-1].startswith("done")
