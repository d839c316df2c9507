# SPDX-License-Identifier: Apache-2.0
"""``mjsense quality``, and ``mjsense inspect --quality``"""

from __future__ import annotations

import argparse
import math
from typing import Any

EXAMPLES = [
    ("mjsense quality data", "Show idle share, jerk, approach and visibility of every episode."),
    ("mjsense quality data --json", "Print the figures for a script."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording.")
    parser.add_argument("--json", action="store_true", help="Print the figures as JSON.")


def run(arguments: argparse.Namespace) -> int:
    import json

    rows = rows_of(arguments.path)
    print(json.dumps(rows, indent=2) if arguments.json else table_of(rows))
    return 0


def rows_of(path: str) -> list[dict[str, Any]]:
    """The figures of each episode, as ``--json`` prints them."""
    import dataclasses

    from mjsense.dataset import Dataset

    rows = [
        {"episode": e.index, "task": e.task, "outcome": e.outcome, **dataclasses.asdict(e.quality)}
        for e in Dataset(path).episodes
    ]
    # JSON has no NaN.
    return [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()} for row in rows]


def table_of(rows: list[dict[str, Any]]) -> str:
    """The figures as a table."""
    lines = ["episode   idle  longest wait  jerk, m/s^3  approach  least visible  instruction"]
    for row in rows:
        idle, wait, jerk, approach = (
            math.nan if row[name] is None else row[name] for name in ("idle", "longest_wait", "jerk", "approach")
        )
        seen = [(share, f"{role} in {camera}") for camera, roles in row["visibility"].items() for role, share in roles.items()]
        least = "{:.0%} {}".format(*min(seen)) if seen else "-"
        lines.append(f"{row['episode']:7}  {idle:5.0%}  {wait:10.2f} s  {jerk:11.1f}  {approach:6.0f}°  {least}  {row['task']}")
    return "\n".join(lines)
