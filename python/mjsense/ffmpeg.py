# SPDX-License-Identifier: Apache-2.0
"""The ffmpeg program that writes videos: the one in ``PATH``, otherwise that of the package imageio-ffmpeg (extra ``video``)."""

from __future__ import annotations

import importlib.util
import os
import shutil
from pathlib import Path

_FFMPEG = "MJSENSE_FFMPEG"


def installed_ffmpeg() -> Path | None:
    """Path of the program in imageio-ffmpeg, or None if it is not installed. Imports no package."""
    spec = importlib.util.find_spec("imageio_ffmpeg")
    for root in (spec.submodule_search_locations or ()) if spec else ():
        for file in sorted(Path(root, "binaries").glob("ffmpeg-*")):
            if os.access(file, os.X_OK):
                return file
    return None


def use_installed_ffmpeg() -> None:
    """Uses imageio-ffmpeg's program to write videos if ``PATH`` contains none. ``MJSENSE_FFMPEG`` has priority."""
    if not os.environ.get(_FFMPEG) and shutil.which("ffmpeg") is None and (file := installed_ffmpeg()):
        os.environ[_FFMPEG] = str(file)
