# SPDX-License-Identifier: Apache-2.0
"""Compares what two CPUs compute in the golden scenes: python tests/golden/compare.py X86_64_FILE AARCH64_FILE

`golden_test --values FILE` writes the files, on x86-64 with MJSENSE_ISA=portable. MuJoCo's library rounds differently on AArch64. Rows whose
bits differ must agree within the bounds below.
"""

import sys
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

# Largest difference of a value, in its own unit, of the first pattern that a row matches. None: not compared.
BOUNDS = (
    ("pick state", None),  # contains accelerations of objects that touch; its poses are in env_states
    ("pick task_info", None),  # text with the poses of env_states
    ("pick env_states/actors/*", 0.02),  # objects come to rest on the table: contacts amplify differences
    ("pick wrist_camera", 1),  # of 255
    ("pick exo_camera_1", 1),
    ("pick *", 2e-4),
    ("* state", 1e-9),
    ("*", 1e-6),
)


def read(path: Path) -> dict[str, np.ndarray]:
    """All rows, by "scene what"."""
    values = {}
    with path.open("rb") as file:
        while line := file.readline().decode():
            key, dtype, size = line.rstrip("\n").split("|")
            values[key] = np.frombuffer(file.read(int(size)), dtype)
    return values


def main() -> int:
    one, other = (read(Path(name)) for name in sys.argv[1:])
    failed = one.keys() ^ other.keys()
    for key in failed:
        print(f"{key}: only one of the files has it")
    equal = 0
    for key in sorted(one.keys() & other.keys()):
        a, b = one[key], other[key]
        if a.tobytes() == b.tobytes():
            equal += 1
            continue
        bound = next(bound for pattern, bound in BOUNDS if fnmatch(key, pattern))
        if a.shape != b.shape:
            failed.add(key)
            print(f"{key}: {a.size} values and {b.size}")
        elif bound is not None:
            # Missing values (NaN, infinity) must be the same.
            a, b = a.astype(float), b.astype(float)
            known = np.isfinite(a)
            largest = np.abs(a[known] - b[known]).max() if np.array_equal(a[~known], b[~known], equal_nan=True) else np.inf
            print(f"{key}: {np.mean(a != b):.2%} of the values differ, by {largest:.2g} at most; the bound is {bound:g}")
            if not largest <= bound:
                failed.add(key)
    print(f"{equal} of {len(one)} rows are equal" + (f"; not within the bounds: {', '.join(sorted(failed))}" if failed else ""))
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
