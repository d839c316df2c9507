#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the compile commands of single files, also of those that CMake compiles in groups (cmake/UnityBuild.cmake), for tools
that examine one file.

usage: tools/compile_database.py BUILD     writes BUILD/files/compile_commands.json
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path


def single_files(entries: list[dict[str, str]]) -> list[dict[str, str]]:
    found = []
    for entry in entries:
        group = Path(entry["file"])
        files = (
            re.findall(r'^#include "(.+)"$', group.read_text(), re.MULTILINE) if group.parent.name == "Unity" else [entry["file"]]
        )
        found += [{**entry, "file": file, "command": entry["command"].replace(entry["file"], file)} for file in files]
    return found


def main(arguments: list[str]) -> int:
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    entries = json.loads(Path(arguments[0], "compile_commands.json").read_text())
    out = Path(arguments[0], "files")
    out.mkdir(exist_ok=True)
    (out / "compile_commands.json").write_text(json.dumps(single_files(entries), indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
