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


def is_wanted(words: list[str]) -> bool:
    """Whether these arguments of the program are ``inspect --quality``."""
    return words[:1] == ["inspect"] and "--quality" in words and not {"-h", "--help"} & {*words}


def inspect(words: list[str]) -> int:
    """Runs ``inspect`` without the option ``--quality``, and adds the figures to its output. Returns its exit code."""
    import json
    import subprocess
    import sys

    words = [word for word in words if word != "--quality"]
    done = subprocess.run([sys.executable, "-m", "mjsense", *words], stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        return done.returncode
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("path")
    for option in ("--sheet", "--ffmpeg"):
        parser.add_argument(option)
    path = parser.parse_known_args(words[1:])[0].path
    if "--json" in words:
        print(json.dumps(json.loads(done.stdout) | {"quality": _rows(path)}, indent=2))
    else:
        print(done.stdout + _table(path))
    return 0


def run(arguments: argparse.Namespace) -> int:
    import json

    print(json.dumps(_rows(arguments.path), indent=2) if arguments.json else _table(arguments.path))
    return 0


def _rows(path: str) -> list[dict[str, Any]]:
    import dataclasses

    from mjsense.dataset import Dataset

    rows = [{"episode": e.index, "task": e.task, "outcome": e.outcome, **dataclasses.asdict(e.quality)} for e in Dataset(path).episodes]
    # JSON has no NaN.
    return [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()} for row in rows]


def _table(path: str) -> str:
    from mjsense.dataset import Dataset

    lines = ["episode   idle  longest wait  jerk, m/s^3  approach  least visible  instruction"]
    for episode in Dataset(path).episodes:
        quality = episode.quality
        seen = [(share, f"{role} in {camera}") for camera, roles in quality.visibility.items() for role, share in roles.items()]
        least = "{:.0%} {}".format(*min(seen)) if seen else "-"
        lines.append(f"{episode.index:7}  {quality.idle:5.0%}  {quality.longest_wait:10.2f} s  {quality.jerk:11.1f}  {quality.approach:6.0f}°  "
                     f"{least}  {episode.task}")  # fmt: skip
    return "\n".join(lines)
