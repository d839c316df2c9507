# SPDX-License-Identifier: Apache-2.0
"""The ffmpeg that writes videos: that of the package imageio-ffmpeg (extra ``video``) or, without it, that of ``PATH``.

The package's program is one file. A distribution's loads two hundred libraries first: Debian's takes 80 ms of processor time to start, of
every camera in every episode, the package's less than 15.
"""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

_FFMPEG = "MJSENSE_FFMPEG"


def installed_ffmpeg() -> Path | None:
    """The program in imageio-ffmpeg, None without it. Imports nothing."""
    spec = importlib.util.find_spec("imageio_ffmpeg")
    for root in (spec.submodule_search_locations or ()) if spec else ():
        for file in sorted(Path(root, "binaries").glob("ffmpeg-*")):
            if os.access(file, os.X_OK):
                return file
    return None


def use_installed_ffmpeg() -> None:
    """Writes videos with imageio-ffmpeg's program if it is installed. ``MJSENSE_FFMPEG`` has priority."""
    if not os.environ.get(_FFMPEG) and (file := installed_ffmpeg()):
        os.environ[_FFMPEG] = str(file)
