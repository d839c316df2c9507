# SPDX-License-Identifier: Apache-2.0
"""``mjsense compare``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense compare results_a results_b", "Compare two policies on the episodes that both have played."),
    ("mjsense compare results_a results_b --allow cameras", "Accept that they see other images."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("a", help="An evaluation, or a recording with failed episodes.")
    parser.add_argument("b", help="Another one, of the same episodes with another policy.")
    parser.add_argument(
        "--allow", nargs="+", default=[], metavar="NAME", help="Settings that may differ in addition to the policy."
    )
    parser.add_argument("--json", action="store_true", help="Print the figures as JSON.")


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense.evaluation.comparison import compare

    comparison = compare(arguments.a, arguments.b, allow=arguments.allow)
    figures = {name: getattr(comparison, name) for name in ("only_a", "only_b", "difference", "interval", "p_value", "left_out")}
    print(json.dumps({"episodes": len(comparison.pairs), **figures}, indent=2) if arguments.json else comparison)
    return 0
