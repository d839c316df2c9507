# SPDX-License-Identifier: Apache-2.0
"""``mjsense export``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands._ray import add_ray, ray_options
from mjsense.export import FORMATS

EXAMPLES = [
    ("mjsense export lerobot data out", "Write the recording in data as a LeRobot v3.0 data set."),
    ("mjsense export lerobot data out --success --map map.toml", "Export the successful episodes with chosen features."),
    ("mjsense export lerobot s3://bucket/pick out --ray auto", "Read a recording of a cluster, and compute the statistics on it."),
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
    parser.add_argument("--trim-idle", action="store_true",
                        help="Leave out the steps in which nothing moves. Formats: lerobot, lerobot21, robomimic, rlds, zarr.")  # fmt: skip
    parser.add_argument("--statistics", choices=("key", "all"), default="key",
                        help="lerobot, lerobot21: frames that the statistics of images use. key: the key frames, by default every 20th; all: all frames.")  # fmt: skip
    add_ray(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")
    parser.add_argument("--encode-again", action="store_true", help="mcap: encode videos that have B-frames again, without them.")


def run(arguments: argparse.Namespace) -> int:
    import importlib

    from mjsense._progress import counter

    if arguments.encode_again and arguments.format != "mcap":
        raise ValueError("--encode-again is an option of the format mcap")
    options: dict[str, Any] = {"encode_again": True} if arguments.encode_again else {}
    if arguments.statistics != "key":
        if arguments.format not in ("lerobot", "lerobot21"):
            raise ValueError("--statistics is an option of the formats lerobot and lerobot21")
        options["statistics_frames"] = 0
    if arguments.trim_idle:
        if arguments.format in ("mcap", "rerun"):
            raise ValueError(f"--trim-idle is an option of lerobot, lerobot21, robomimic, rlds and zarr; {arguments.format} shows episodes with their times")
        options["trim_idle"] = True
    options |= {"map": arguments.map, "episodes": arguments.episodes, "success": arguments.success or None}
    report = counter("episodes", False if arguments.quiet else None)
    if arguments.ray:
        from mjsense.cluster import export_on_ray

        export_on_ray(arguments.format, arguments.path, arguments.out, **options, progress=report, **ray_options(arguments))
        return 0
    function = getattr(importlib.import_module(f"mjsense.export.{arguments.format}"), f"export_{arguments.format}")
    function(arguments.path, arguments.out, progress=report, **options)
    return 0
