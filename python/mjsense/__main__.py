# SPDX-License-Identifier: Apache-2.0
"""The ``mjsense`` program: ``python -m mjsense``, and the command that the package installs."""

from __future__ import annotations

import os
import signal
import sys

from mjsense import _core, commands
from mjsense.cluster import program as cluster
from mjsense.cluster import tools
from mjsense.commands import quality, record_format
from mjsense.tasks.assets import use_installed_files


def main() -> int:
    """Runs the program with the arguments of this process and returns its exit code."""
    # The program handles Ctrl-C itself, as it does outside of Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    words = sys.argv[1:]
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    if words and words[0] in commands.COMMANDS:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        return commands.run(words)
    if record_format.is_wanted(words):
        return record_format.run(words)
    if quality.is_wanted(words):
        return quality.inspect(words)
    if cluster.is_wanted(words):
        signal.signal(signal.SIGINT, signal.default_int_handler)
        return cluster.run(words)
    if tools.path_of(words) is not None:
        return tools.run(words)
    if words[:2] == ["complete", "--"] and len(words) > 3 and words[2] in commands.COMMANDS:
        print(*commands.completions(words[2:]), sep="\n")
        return 0
    use_installed_files(words)
    return _core.run_program([b"mjsense", *map(os.fsencode, words)], list(commands.COMMANDS.items()))


if __name__ == "__main__":
    sys.exit(main())
