# SPDX-License-Identifier: Apache-2.0
"""``mjsense replay``"""

from __future__ import annotations

import argparse

from mjsense.commands.parser import add_episodes, episodes_of

EXAMPLES = [
    ("mjsense replay data", "Simulate all episodes with the recorded controls, and compare every state."),
    ("mjsense replay data --from states", "Compute all sensors from the recorded states, and compare every stream."),
    ("mjsense replay data --verify --episodes 0 3", "Both, for the first and the fourth episode."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording.")
    parser.add_argument(
        "--from",
        dest="from_",
        choices=("actions", "states"),
        default="actions",
        help="actions: simulate with the recorded controls and compare the states. "
        "states: compute the sensors from the recorded states and compare them.",
    )
    parser.add_argument("--verify", action="store_true", help="Do both.")
    add_episodes(parser, "Positions of episodes in the recording, such as 3 17 or 0-9,12; by default all.")
    parser.add_argument(
        "--worlds", type=int, default=4, metavar="N", help="Number of episodes whose sensors are computed in parallel."
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="Number of threads; 0: one per available CPU.")
    parser.add_argument("--json", action="store_true", help="Print the report as JSON.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense.commands import FAILED
    from mjsense.dataset import check_replay

    report = check_replay(
        arguments.path,
        actions=arguments.verify or arguments.from_ == "actions",
        states=arguments.verify or arguments.from_ == "states",
        episodes=episodes_of(arguments),
        num_worlds=arguments.worlds,
        threads=arguments.threads,
        progress=False if arguments.quiet else None,
    )
    if arguments.json:
        print(json.dumps(report.to_dict(), indent=2))
    elif not (arguments.quiet and report.ok):
        print(report)
    return 0 if report.ok else FAILED
