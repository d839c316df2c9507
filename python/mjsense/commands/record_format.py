# SPDX-License-Identifier: Apache-2.0
"""``mjsense record ... --format lerobot``: the C++ program records, and the recording is converted meanwhile."""

from __future__ import annotations

import argparse
import os
import sys
from typing import NoReturn

from mjsense.commands import message_of

_REFUSED = ("--ray", "--shard", "--append", "--overwrite", "--config")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError(f"{message}; see mjsense record --help")


def is_wanted(words: list[str]) -> bool:
    """Whether these arguments of the program ask for a recording in the format of another program."""
    given = {word.split("=")[0] for word in words}
    return words[:1] == ["record"] and "--format" in given and not {"-h", "--help"} & given


def run(words: list[str]) -> int:
    """Runs the command. Returns the exit code of ``mjsense record``."""
    from mjsense import _core
    from mjsense.recording.ffmpeg import use_installed_ffmpeg

    parser = _Parser(prog="mjsense record", add_help=False, allow_abbrev=False)
    parser.add_argument("--format", choices=["lerobot", "mjsense"])
    parser.add_argument("--out", required=True)
    parser.add_argument("--map")
    parser.add_argument("--trim-idle", action=argparse.BooleanOptionalAction)
    parser.add_argument("--keep-recording", action="store_true")
    parser.add_argument("--resume", action="store_true")
    try:
        given, others = parser.parse_known_args(words[1:])
        for option in _REFUSED:
            if given.format == "lerobot" and any(word.split("=")[0] == option for word in others):
                raise ValueError(f"{option} cannot be combined with --format lerobot")
        use_installed_ffmpeg()
        quiet = bool({"-q", "--quiet"} & set(others))

        def record(out: str, *more: str) -> int:
            command = ["mjsense", "record", *others, "--out", out, *(["--resume"] if given.resume else []), *more]
            return _core.run_program([os.fsencode(word) for word in command], [])

        if given.format == "mjsense":
            return record(given.out)
        from mjsense.exporting.record_lerobot import CompleteError, converted

        try:
            with converted(given.out, resume=given.resume, map=given.map, trim_idle=given.trim_idle, keep_recording=given.keep_recording,
                           quiet=quiet) as folder:  # fmt: skip
                code = record(str(folder), "--no-sheet", "--no-tree")
        except CompleteError as error:
            print(error)
            return 0
        if not quiet and "--json" not in others:
            for path in (given.out, str(folder)):  # the recording is there if it is unfinished or kept
                if os.path.exists(path):
                    print(f"\n{_core.tree_text(path)}", end="", flush=True)
        if not quiet and os.path.exists(given.out):
            print(f"The LeRobot data set is in {given.out}.", file=sys.stderr)
        return code
    except (ValueError, LookupError, OSError, RuntimeError, ImportError) as error:
        print(f"mjsense record: {message_of(error)}", file=sys.stderr)
        return 2
