# SPDX-License-Identifier: Apache-2.0
"""Runs all benchmarks, or the named ones, one after the other: `./dev bench [name ...]`."""

import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
# Not benchmarks.
SHARED = {
    "run",
    "harness",
    "fetch",
    "opengl",
    "images",
    "camera_scenes",
    "camera_rate",
    "pictures",
    "page",
    "figures",
}

ASKED_FOR = {"builds"}  # run only if named: needs a second build


def main() -> int:
    names = [a for a in sys.argv[1:] if not a.startswith("-")]
    flags = [a for a in sys.argv[1:] if a.startswith("-")]
    known = sorted(p.stem for p in HERE.glob("*.py") if p.stem not in SHARED)
    unknown = [n for n in names if n not in known]
    if unknown:
        print(f"no benchmark named {', '.join(unknown)}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    failed = [
        n for n in names or sorted({*known} - ASKED_FOR) if subprocess.run([sys.executable, HERE / f"{n}.py", *flags]).returncode
    ]
    if failed:
        print("failed: " + ", ".join(failed), file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
