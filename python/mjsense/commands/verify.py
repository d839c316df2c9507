# SPDX-License-Identifier: Apache-2.0
"""``mjsense verify``"""

from __future__ import annotations

import argparse

EXAMPLES = [("mjsense verify data", "Check all checksums."), ("mjsense verify --decode data", "Decode every video frame too.")]
ENDS_AT_CTRL_C = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", help="A recording, a house_N folder or an .h5 file.")
    parser.add_argument("--json", action="store_true", help="Print JSON.")
    parser.add_argument("--decode", action="store_true", help="Decode every frame of the videos.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")
    parser.add_argument("--ffmpeg", default="", metavar="PATH", help="Path of the ffmpeg program.")


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense.cluster import tools
    from mjsense.commands import FAILED
    from mjsense.core.progress_line import ProgressLine, interactive
    from mjsense.recording.ffmpeg import use_installed_ffmpeg

    use_installed_ffmpeg()
    line = ProgressLine() if interactive() and not arguments.quiet else None
    try:
        found = tools.verify(
            arguments.path, decode=arguments.decode, ffmpeg=arguments.ffmpeg, progress=line.show if line else None
        )
    finally:
        if line is not None:
            line.clear()
    if arguments.json or not arguments.quiet or not found["ok"]:
        print(
            json.dumps({key: value for key, value in found.items() if key != "of_job"}, indent=2)
            if arguments.json
            else tools.verify_text(found)
        )
    return 0 if found["ok"] else FAILED
