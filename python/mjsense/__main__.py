# SPDX-License-Identifier: Apache-2.0
"""The ``mjsense`` program: ``python -m mjsense``, and the command that the package installs."""

from __future__ import annotations

import os
import signal
import sys
from itertools import pairwise

from mjsense import _core
from mjsense.assets import use_installed_meshes
from mjsense.ffmpeg import use_installed_ffmpeg


def main() -> int:
    """Runs the program with the arguments of this process and returns its exit code."""
    # The program handles Ctrl-C itself, as it does outside of Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    words = sys.argv[1:]
    if "--meshes=real" in words or ("--meshes", "real") in pairwise(words):
        use_installed_meshes()
    use_installed_ffmpeg()
    return _core.run_program([b"mjsense", *map(os.fsencode, words)])


if __name__ == "__main__":
    sys.exit(main())
