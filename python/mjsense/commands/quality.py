# SPDX-License-Identifier: Apache-2.0
"""``mjsense quality``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense quality data", "Show idle share, jerk, approach and visibility of every episode."),
    ("mjsense quality data --json", "Print the figures for a script."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording.")
    parser.add_argument("--json", action="store_true", help="Print the figures as JSON.")


def run(arguments: argparse.Namespace) -> int:
    import dataclasses
    import json

    import numpy as np

    from mjsense.dataset import Dataset

    figures = [(episode, episode.quality) for episode in Dataset(arguments.path).episodes]
    if arguments.json:
        rows = [{"episode": e.index, "task": e.task, "outcome": e.outcome, **dataclasses.asdict(q)} for e, q in figures]
        # JSON has no NaN.
        rows = [{k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()} for row in rows]
        print(json.dumps(rows, indent=2))
        return 0
    print("episode   idle  longest wait  jerk, m/s^3  approach  least visible  instruction")
    for episode, quality in figures:
        seen = [(share, f"{role} in {camera}") for camera, roles in quality.visibility.items() for role, share in roles.items()]
        least = "{:.0%} {}".format(*min(seen)) if seen else "-"
        print(f"{episode.index:7}  {quality.idle:5.0%}  {quality.longest_wait:10.2f} s  {quality.jerk:11.1f}  {quality.approach:6.0f}°  "
              f"{least}  {episode.task}")  # fmt: skip
    return 0
