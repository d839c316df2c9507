# SPDX-License-Identifier: Apache-2.0
"""``mjsense export``"""

from __future__ import annotations

import argparse

from mjsense.export import FORMATS

EXAMPLES = [
    ("mjsense export lerobot data out", "Write the recording in data as a LeRobot v3.0 data set."),
    ("mjsense export lerobot data out --success --map map.toml", "Export the successful episodes with chosen features."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    formats = "; ".join(f"{name}: {about}" for name, about in FORMATS.items())
    parser.add_argument("format", choices=FORMATS, metavar="FORMAT", help=f"{formats}.")
    parser.add_argument("path", metavar="IN", help="A recording.")
    parser.add_argument("out", metavar="OUT", help="Output, which must not exist.")
    parser.add_argument("--map", metavar="FILE", help="TOML file that chooses features and cameras; by default joint positions and all cameras.")
    parser.add_argument("--episodes", type=int, nargs="+", metavar="N", help="Positions of episodes in the recording; by default all.")
    parser.add_argument("--success", action="store_true", help="Export only successful episodes.")


def run(arguments: argparse.Namespace) -> int:
    import importlib
    import sys

    function = getattr(importlib.import_module(f"mjsense.export.{arguments.format}"), f"export_{arguments.format}")
    shown = sys.stderr.isatty()

    def progress(done: int, total: int) -> None:
        if shown:
            print(f"\r{done} of {total} episodes", end="" if done < total else "\n", file=sys.stderr, flush=True)

    function(arguments.path, arguments.out, map=arguments.map, episodes=arguments.episodes, success=arguments.success or None, progress=progress)
    return 0
