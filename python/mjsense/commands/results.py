# SPDX-License-Identifier: Apache-2.0
"""``mjsense results``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense results data", "Print success rates, and write data/results.parquet and data/report.html."),
    ("mjsense results data --json", "Print a row for each episode for a script, and write nothing."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="An evaluation, or any recording.")
    parser.add_argument(
        "--out", metavar="DIR", help="Folder of results.parquet and report.html; by default that of the recording."
    )
    parser.add_argument("--json", action="store_true", help="Print a row for each episode as JSON, and write no files.")


def run(arguments: argparse.Namespace) -> int:
    import dataclasses
    import json
    import math
    from pathlib import Path

    from mjsense.commands.output import tell
    from mjsense.evaluation.report import require_parquet, results

    if not arguments.json:
        require_parquet()
    found = results(arguments.path)
    if arguments.json:
        rows = [dataclasses.asdict(row) for row in found.rows]
        # JSON has no NaN.
        print(
            json.dumps(
                [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()} for row in rows], indent=2
            )
        )
        return 0
    print(found)
    folder = Path(arguments.out) if arguments.out else found.dataset.root
    folder = folder if folder.is_dir() or arguments.out else folder.parent
    folder.mkdir(parents=True, exist_ok=True)
    for path in found.write(folder):
        tell(f"Wrote {path}.")
    return 0
