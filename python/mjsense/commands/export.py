# SPDX-License-Identifier: Apache-2.0
"""``mjsense export``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands._ray import add_ray, ray_options
from mjsense.commands.parser import add_episodes, episodes_of
from mjsense.exporting.formats import FORMATS, OPTIONS, formats_with, given_options

EXAMPLES = [
    ("mjsense export lerobot data out", "Write the recording in data as a LeRobot v3.0 data set."),
    ("mjsense export lerobot data out --success --map map.toml", "Export the successful episodes with chosen features."),
    ("mjsense export rlds s3://bucket/pick out --ray auto", "Export a recording of a cluster, on it."),
    ("mjsense export rerun data out && rerun out/*.rrd", "Show the videos, curves and the scene in the Rerun viewer."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    formats = "; ".join(f"{name}: {format.about}" for name, format in FORMATS.items())
    parser.add_argument("format", choices=FORMATS, metavar="FORMAT", help=f"{formats}.")
    parser.add_argument("path", metavar="IN", help="A recording.")
    parser.add_argument("out", metavar="OUT", help="Output, which must not exist.")
    parser.add_argument(
        "--map", metavar="FILE", help="TOML file that chooses features and cameras; by default joint positions and all cameras."
    )
    add_episodes(parser, "Positions of episodes in the recording, such as 3 17 or 0-9,12; by default all.")
    parser.add_argument("--success", action="store_true", help="Export only successful episodes.")
    for name, option in OPTIONS.items():
        switch = argparse.BooleanOptionalAction if option.default is None else "store_true"
        about = f"{option.about} Formats: {', '.join(formats_with(name))}.".replace("%", "%%")
        parser.add_argument(_flag(name), action=switch, help=about)
    add_ray(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    import contextlib
    import io

    from mjsense.core.progress_line import counter
    from mjsense.exporting import export

    given = {name: getattr(arguments, name) for name in OPTIONS}
    options: dict[str, Any] = given_options(arguments.format, given, {name: _flag(name) for name in OPTIONS})
    options |= {"map": arguments.map, "episodes": episodes_of(arguments), "success": arguments.success or None}
    report = counter("episodes", False if arguments.quiet else None)
    with contextlib.redirect_stderr(io.StringIO()) if arguments.quiet else contextlib.nullcontext():
        if arguments.ray:
            from mjsense.cluster import export_on_ray

            export_on_ray(
                arguments.path, arguments.out, format=arguments.format, **options, progress=report, **ray_options(arguments)
            )
            return 0
        export(arguments.path, arguments.out, format=arguments.format, progress=report, **options)
        if not arguments.quiet:
            print(f"Wrote {arguments.out}.")
    return 0


def _flag(option: str) -> str:
    return f"--{option.replace('_', '-')}"
