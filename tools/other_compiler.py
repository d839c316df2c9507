#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks C++ files with clang's front end, using the compile commands of a GCC build. Finds errors and warnings that GCC does not
report.

usage: tools/other_compiler.py BUILD [FILE ...]     without files: all of src/ and python/bindings/, in the groups of
    cmake/UnityBuild.cmake
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GCC_ALONE = ("-mmove-max=", "-mstore-max=")  # cmake/Isa.cmake


def command_of(entry: dict[str, str]) -> list[str]:
    """clang's command that checks the file without output files."""
    words = shlex.split(entry["command"])
    if Path(words[0]).name == "ccache":
        words = words[1:]
    flags = []
    skip = False
    for word in words[1:]:
        if skip or word == "-c":
            skip = False
        elif word in ("-o", "-MF", "-MT"):
            skip = True
        elif word != "-MD" and not word.startswith(GCC_ALONE):
            flags.append(word)
    return ["clang++", *flags, "-fsyntax-only", "-Werror", "-Wno-unknown-warning-option"]


def main(arguments: list[str]) -> int:
    if not arguments:
        print(__doc__, file=sys.stderr)
        return 2
    wanted = {str((ROOT / name).resolve()) for name in arguments[1:]}
    entries = [
        entry
        for entry in json.loads(Path(arguments[0], "compile_commands.json").read_text())
        if (
            entry["file"] in wanted
            if wanted
            else "/Unity/" in entry["file"]
            or any(map(Path(entry["file"]).is_relative_to, (ROOT / "src", ROOT / "python/bindings")))
        )
    ]

    def check(entry: dict[str, str]) -> bool:
        done = subprocess.run(command_of(entry), cwd=entry["directory"], capture_output=True, text=True)
        if done.returncode:
            print(done.stderr, file=sys.stderr)
        return done.returncode == 0

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        wrong = list(pool.map(check, entries)).count(False)
    print(f"clang: {len(entries)} files, {wrong} with errors", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
