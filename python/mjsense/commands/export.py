# SPDX-License-Identifier: Apache-2.0
"""``mjsense export``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands._ray import add_ray, ray_options
from mjsense.commands.table import NAMES

EXAMPLES = [
    ("mjsense export lerobot data out", "Write the recording in data as a LeRobot v3.0 data set."),
    ("mjsense export lerobot data out --success --map map.toml", "Export the successful episodes with chosen features."),
    ("mjsense export rlds s3://bucket/pick out --ray auto", "Export a recording of a cluster, on it."),
    ("mjsense export rerun data out && rerun out/*.rrd", "Show the videos, curves and the scene in the Rerun viewer."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    formats = "; ".join(f"{name}: {about}" for name, about in NAMES["formats"].items())
    parser.add_argument("format", choices=NAMES["formats"], metavar="FORMAT", help=f"{formats}.")
    parser.add_argument("path", metavar="IN", help="A recording.")
    parser.add_argument("out", metavar="OUT", help="Output, which must not exist.")
    parser.add_argument("--map", metavar="FILE", help="TOML file that chooses features and cameras; by default joint positions and all cameras.")
    parser.add_argument("--episodes", type=int, nargs="+", metavar="N", help="Positions of episodes in the recording; by default all.")
    parser.add_argument("--success", action="store_true", help="Export only successful episodes.")
    parser.add_argument("--trim-idle", action=argparse.BooleanOptionalAction,
                        help="Leave out the steps in which nothing moves; by default in episodes whose task places an object. "
                        "Formats: lerobot, lerobot21, robomimic, rlds, zarr.")  # fmt: skip
    parser.add_argument("--exact-rate", action="store_true",
                        help="lerobot, lerobot21: keep a rate that is not a whole number, which LeRobot's own tools cannot edit. By default it is "
                        "rounded if that changes it by at most 5 %%.")  # fmt: skip
    add_ray(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")
    parser.add_argument("--encode-again", action="store_true", help="mcap: encode videos that have B-frames again, without them.")


def run(arguments: argparse.Namespace) -> int:
    import contextlib
    import importlib
    import io

    from mjsense.core.progress_line import counter

    if arguments.encode_again and arguments.format != "mcap":
        raise ValueError("--encode-again is an option of the format mcap")
    if arguments.exact_rate and arguments.format not in ("lerobot", "lerobot21"):
        raise ValueError("--exact-rate is an option of the formats lerobot and lerobot21")
    options: dict[str, Any] = {name: True for name in ("encode_again", "exact_rate") if getattr(arguments, name)}
    if arguments.format not in ("mcap", "rerun"):
        options["trim_idle"] = arguments.trim_idle
    elif arguments.trim_idle:
        raise ValueError(f"--trim-idle is an option of lerobot, lerobot21, robomimic, rlds and zarr; {arguments.format} shows episodes with their times")
    options |= {"map": arguments.map, "episodes": arguments.episodes, "success": arguments.success or None}
    report = counter("episodes", False if arguments.quiet else None)
    with contextlib.redirect_stderr(io.StringIO()) if arguments.quiet else contextlib.nullcontext():
        if arguments.ray:
            from mjsense.cluster import export_on_ray

            export_on_ray(arguments.format, arguments.path, arguments.out, **options, progress=report, **ray_options(arguments))
            return 0
        function = getattr(importlib.import_module(f"mjsense.exporting.{arguments.format}"), f"export_{arguments.format}")
        function(arguments.path, arguments.out, progress=report, **options)
        if not arguments.quiet:
            print(f"Wrote {arguments.out}.")
    return 0
