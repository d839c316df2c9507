# SPDX-License-Identifier: Apache-2.0
"""``mjsense export``"""

from __future__ import annotations

import argparse

from mjsense.export import FORMATS

EXAMPLES = [
    ("mjsense export lerobot data out", "Write the recording in data as a LeRobot v3.0 data set."),
    ("mjsense export lerobot data out --success --map map.toml", "Export the successful episodes with chosen features."),
    ("mjsense export rerun data out && rerun out/*.rrd", "Show the videos, curves and the scene in the Rerun viewer."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    formats = "; ".join(f"{name}: {about}" for name, about in FORMATS.items())
    parser.add_argument("format", choices=FORMATS, metavar="FORMAT", help=f"{formats}.")
    parser.add_argument("path", metavar="IN", help="A recording.")
    parser.add_argument("out", metavar="OUT", help="Output, which must not exist.")
    parser.add_argument("--map", metavar="FILE", help="TOML file that chooses features and cameras; by default joint positions and all cameras.")
    parser.add_argument("--episodes", type=int, nargs="+", metavar="N", help="Positions of episodes in the recording; by default all.")
    parser.add_argument("--success", action="store_true", help="Export only successful episodes.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")
    parser.add_argument("--encode-again", action="store_true", help="mcap: encode videos that have B-frames again, without them.")


def run(arguments: argparse.Namespace) -> int:
    import importlib

    from mjsense._progress import counter

    if arguments.encode_again and arguments.format != "mcap":
        raise ValueError("--encode-again is an option of the format mcap")
    options = {"encode_again": True} if arguments.encode_again else {}
    function = getattr(importlib.import_module(f"mjsense.export.{arguments.format}"), f"export_{arguments.format}")
    success = arguments.success or None
    function(arguments.path, arguments.out, map=arguments.map, episodes=arguments.episodes, success=success, progress=counter("episodes", False if arguments.quiet else None), **options)
    return 0
