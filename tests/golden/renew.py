# SPDX-License-Identifier: Apache-2.0
"""Rewrites the hashes of this CPU: python tests/golden/renew.py "reason for the change" [--build build/dev]

Runs the test with every instruction set of the kernels that this CPU supports. Lines of other CPUs are not changed; they are
outdated until this script is run on such a CPU, and the test fails there. The reason becomes the first line of the file and
belongs in the commit message.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
FILE = HERE / "hashes.txt"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reason")
    parser.add_argument("--build", type=Path, default=HERE.parents[1] / "build/dev")
    options = parser.parse_args()
    if len(options.reason.split()) < 2:
        parser.error("the reason must have at least two words")
    fresh: dict[str, str] = {}
    for isa in ("portable", "avx2", "avx512"):
        done = subprocess.run([options.build / "golden_test", "--print"], env={**os.environ, "MJSENSE_ISA": isa},
                              capture_output=True, text=True)
        if done.returncode == 77:
            print(f"{isa}: not supported by this CPU", file=sys.stderr)
        elif done.returncode != 0:
            sys.exit(done.stdout + done.stderr)
        else:
            fresh |= dict(line.rsplit(" ", 1) for line in done.stdout.splitlines())
    cpu = next(iter(fresh)).split(" ", 1)[0]
    old = FILE.read_text().splitlines() if FILE.exists() else []
    lines = dict(line.rsplit(" ", 1) for line in old if line and not line.startswith("#"))
    before = {key: value for key, value in lines.items() if key.split(" ", 1)[0] == cpu}
    lines = {key: value for key, value in lines.items() if key not in before} | fresh
    changed = sorted(key for key in before.keys() | fresh.keys() if before.get(key) != fresh.get(key))
    FILE.write_text(f"# {options.reason}\n# CPU, kernels, scene, what, FNV-1a of all rows. Written by tests/golden/renew.py\n"
                    + "".join(f"{key} {value}\n" for key, value in sorted(lines.items())))
    print(f"{len(changed)} of {len(fresh)} hashes changed" + "".join(f"\n  {key}" for key in changed[:20]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
