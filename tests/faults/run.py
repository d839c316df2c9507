#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the long form of the fault suite and writes the table of docs/faults.md.

    python tests/faults/run.py                    all kinds, takes hours
    python tests/faults/run.py flips=1000 kills   only these kinds, with 1000 trials of flips; other lines of the table are kept
    python tests/faults/run.py --no-table ...     print only

The program is build/dev/record_fake or $MJSENSE_RECORD_FAKE, for example that of a build with ASan and UBSan. `generated` and
`crafted_readers` also need the Python package (PYTHONPATH=build/dev/python).
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from pathlib import Path

import crafted
import faults

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/faults.md"
# Trials of the long form; None: one trial for each entry of the kind's list.
TRIALS = {"kills": 300, "killed_changes": 200, "full_disks": 100, "full_disk_repairs": 40, "file_limits": 100, "flips": 1000, "truncations": 200, "mutations": 2000, "generated": 3000, "crafted_readers": len(crafted.CASES), "hostile": None, "staged": None, "encoders": None}
HEAD = "| fault | trials | lost | unnoticed | crashed | hung |\n| --- | --- | --- | --- | --- | --- |\n"
BEGIN, END = "<!-- table of tests/faults/run.py -->\n", "<!-- end -->"


def line_of(row: faults.Row) -> str:
    return f"| {row.kind} | {row.trials} | {row.lost} | {row.unnoticed} | {row.crashed} | {row.hung} |"


def update(rows: list[faults.Row]) -> None:
    page = PAGE.read_text()
    before, rest = page.split(BEGIN)
    table, after = rest.split(END, 1)
    lines = {line.split("|")[1].strip(): line for line in table.splitlines()[2:] if line.startswith("|")}
    lines |= {row.kind: line_of(row) for row in rows}
    PAGE.write_text(before + BEGIN + HEAD + "\n".join(lines.values()) + "\n" + END + after)


def main(arguments: list[str]) -> int:
    table = "--no-table" not in arguments
    words = [re.fullmatch(r"(\w+)(?:=(\d+))?", a) for a in arguments if a != "--no-table"]
    unknown = [a for a, w in zip((a for a in arguments if a != "--no-table"), words, strict=True) if w is None or w[1] not in TRIALS]
    if unknown:
        print(f"{__doc__}\nnot a kind: {', '.join(unknown)}; there are {', '.join(TRIALS)}", file=sys.stderr)
        return 2
    asked = dict(w.groups() for w in words if w) or dict.fromkeys(TRIALS)
    program = Path(os.environ.get("MJSENSE_RECORD_FAKE", ROOT / "build/dev/record_fake"))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        lab = faults.Lab(program, Path(folder))
        for kind, trials in asked.items():
            begun = time.time()
            count = int(trials) if trials else TRIALS[kind]
            row = getattr(faults, kind)(lab, count) if count else getattr(faults, kind)(lab)
            print(line_of(row), f"{time.time() - begun:.0f} s", *row.notes, sep="\n  ", flush=True)
            rows.append(row)
            if table:
                update(rows)
    return 0 if all(row.clean for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
