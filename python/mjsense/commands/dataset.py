# SPDX-License-Identifier: Apache-2.0
"""``mjsense dataset``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands.parser import add_episodes, episodes_of, positions

EXAMPLES = [
    ("mjsense dataset delete data data_clean --episodes 3 17", "Write the recording in data without two episodes."),
    ("mjsense dataset split data parts --parts train=0.8 test=0.2", "Write two recordings, parts/train and parts/test."),
    ("mjsense dataset split data parts --parts good=0-9,12 other=10,11", "Choose the episodes of each part by their positions."),
    ("mjsense dataset merge data_monday data_tuesday data_all", "Write the episodes of two recordings as one recording."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "action",
        choices=["delete", "split", "merge"],
        help="delete: leave out episodes; split: write parts; merge: join recordings.",
    )
    parser.add_argument(
        "paths",
        metavar="PATH",
        nargs="+",
        help="IN ... OUT: one recording, for merge several, and the output, which must not exist.",
    )
    add_episodes(parser, "delete: positions of the episodes to leave out, such as 3 17 or 0-9,12.")
    parser.add_argument(
        "--parts", nargs="+", metavar="PART", help="split: NAME=0.8, a share of all episodes, or NAME=0-9,12, their positions."
    )


def _part(text: str) -> tuple[str, Any]:
    name, _, given = text.partition("=")
    try:
        if "." in given or given == "1":
            return name, float(given)
        return name, positions(given)
    except (ValueError, argparse.ArgumentTypeError):
        raise ValueError(f"--parts: '{text}' is not of the form NAME=0.8 or NAME=0-9,12") from None


def run(arguments: argparse.Namespace) -> int:
    from mjsense.dataset.edit import delete_episodes, merge_datasets, split_dataset

    *roots, out = arguments.paths
    needed = {"delete": "episodes", "split": "parts"}.get(arguments.action)
    for name in ("episodes", "parts"):
        if (getattr(arguments, name) is not None) != (name == needed):
            raise ValueError(f"{arguments.action}: --{name} is {'missing' if name == needed else 'an option of another action'}")
    if not roots or (arguments.action != "merge" and len(roots) > 1):
        count = "at least one recording" if arguments.action == "merge" else "one recording"
        raise ValueError(
            f"{arguments.action}: {len(roots)} recordings and the output '{out}' are given; {count} and the output are needed"
        )
    if arguments.action == "delete":
        made = [delete_episodes(roots[0], out, episodes_of(arguments) or [])]
    elif arguments.action == "split":
        parts = [_part(text) for text in arguments.parts]
        if len(dict(parts)) < len(parts):
            raise ValueError("--parts: a name is given twice")
        made = [*split_dataset(roots[0], out, dict(parts)).values()]
    else:
        made = [merge_datasets(roots, out)]
    print(f"Wrote {', '.join(map(str, made))}.")
    return 0
