# SPDX-License-Identifier: Apache-2.0
"""``mjsense inspect``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense inspect data", "Show what a recording contains."),
    ("mjsense inspect data --sheet sheet.png", "Write a picture of every camera too."),
    ("mjsense inspect data --quality", "Show how each episode was performed too."),
]
ENDS_AT_CTRL_C = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording, a house_N folder or an .h5 file.")
    parser.add_argument("--json", action="store_true", help="Print JSON.")
    parser.add_argument("--sheet", metavar="FILE.png", help="Write a contact sheet of the videos.")
    parser.add_argument("--ffmpeg", default="", metavar="PATH", help="Path of the ffmpeg program.")
    parser.add_argument(
        "--quality", action="store_true", help="Show how each episode was performed too: idle share, jerk, approach, visibility."
    )


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense import _core
    from mjsense.cluster import tools
    from mjsense.commands import quality
    from mjsense.recording.ffmpeg import use_installed_ffmpeg

    local, text, as_json = tools.inspect(arguments.path)
    # Before anything is printed, so that a failure prints one line only.
    if arguments.sheet is not None:
        use_installed_ffmpeg()
        _core.contact_sheet(local, arguments.sheet, arguments.ffmpeg)
    if arguments.quality:
        rows = quality.rows_of(arguments.path)
        text, as_json = f"{text}\n{quality.table_of(rows)}", json.dumps(json.loads(as_json) | {"quality": rows}, indent=2)
    print(as_json if arguments.json else text)
    return 0
