# SPDX-License-Identifier: Apache-2.0
"""``mjsense replay``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense replay data", "Replay all episodes in MuJoCo, and compare every state."),
    ("mjsense replay data --episodes 0 3", "Replay the first and the fourth episode."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording.")
    parser.add_argument("--episodes", type=int, nargs="+", metavar="N", help="Positions of episodes in the recording; by default all.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Do not show progress.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.commands import FAILED
    from mjsense.dataset import check_replay

    report = check_replay(arguments.path, episodes=arguments.episodes, progress=False if arguments.quiet else None)
    print(report)
    return 0 if report.ok else FAILED
