# SPDX-License-Identifier: Apache-2.0
"""Writes the hashes of this CPU anew: python tests/golden/renew.py "why the bits changed" [--build build/dev]

Every instruction set of the kernels that this CPU has is run; lines of other CPUs stay, and are wrong from here on until somebody
renews them there (CI says so). The reason becomes the file's first line and belongs into the commit's message.
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
        parser.error("say in a few words why the bits changed")
    fresh: dict[str, str] = {}
    for isa in ("portable", "avx2", "avx512"):
        done = subprocess.run([options.build / "golden_test", "--print"], env={**os.environ, "MJSENSE_ISA": isa},
                              capture_output=True, text=True)
        if done.returncode == 77:
            print(f"{isa}: this CPU does not have it", file=sys.stderr)
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
