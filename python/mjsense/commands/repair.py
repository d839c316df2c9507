# SPDX-License-Identifier: Apache-2.0
"""``mjsense repair``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense repair data", "Publish the finished episodes of an interrupted recording."),
    ("mjsense repair --json data/house_0", "Print the result as JSON."),
]
ENDS_AT_CTRL_C = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording, a house_N folder or an .h5 file.")
    parser.add_argument("--json", action="store_true", help="Print JSON.")


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense.cluster import tools
    from mjsense.commands import FAILED

    made = tools.repair(arguments.path)
    lines = [*made["actions"], *(f"cannot repair {failure}" for failure in made["failures"])]
    print(json.dumps(made, indent=2) if arguments.json else "\n".join(lines) or "nothing to repair")
    return FAILED if made["failures"] else 0
