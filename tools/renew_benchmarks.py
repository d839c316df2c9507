#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the benchmarks of the package again: python tools/renew_benchmarks.py

Needed when an episode starts differently than before; results of the old and the new benchmark must not be compared.
"""

import json
import tempfile
from pathlib import Path

from mjsense.evaluation.benchmarks import create_benchmark, digests_of

FOLDER = Path(__file__).parents[1] / "python/mjsense/evaluation/shipped"
BENCHMARKS = {
    "pick": {"task": "pick", "scene": "assorted", "split": "test"},
    "pick_and_place": {"task": "pick_and_place"},
    "open": {"task": "open"},
}

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, options in BENCHMARKS.items():
        with tempfile.TemporaryDirectory() as folder:
            made = create_benchmark(**options, out=f"{folder}/{name}", episodes=50, seed=2_026, meshes="shapes", progress=False)
            table = digests_of(made)
        rows = {"digests": "%digests%"}
        text = json.dumps({**table, **rows}, indent=1)
        digests = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in table["digests"].items())
        (FOLDER / f"{name}.json").write_text(text.replace('"%digests%"', f"{{\n{digests}\n }}") + "\n")
        print(name, len(made.episodes), table["checksum"])
