# SPDX-License-Identifier: Apache-2.0
"""The ffmpeg program that writes and reads videos: the one in ``PATH``, otherwise that of the package imageio-ffmpeg (extra
``video``)."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

_FFMPEG = "MJSENSE_FFMPEG"
_SILENCE_S, _MIN_CPU_S, _BYTES_PER_CPU_S, _MEMORY = 60, 60, 50_000, 4 << 30  # as in replay/video_probe.cc


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


def frames_of(video: Path, descriptor: int, options: Sequence[str], output: Sequence[str], max_bytes: int) -> bytes:
    """Raw frames of a video, which ffmpeg prints; ``options`` are those of the input.

    As in the C++ library, ffmpeg reads only this file, as MP4 with H.264 or as Matroska with FFV1, and its time, memory, output
    and messages are limited. It finds the file by our open descriptor, so that the name is neither an option nor a protocol.

    Raises:
        RuntimeError: There is no ffmpeg, or it fails or exceeds a limit.
    """
    from mjsense import _core

    use_installed_ffmpeg()
    program = os.environ.get(_FFMPEG) or shutil.which("ffmpeg")
    if not program:
        raise RuntimeError(f"Reading the video {video} needs PyAV or ffmpeg: pip install 'mjsense[dataset]'")
    kind = "matroska" if video.suffix == ".mkv" else "mov"
    command = [
        program,
        "-nostdin",
        "-v",
        "error",
        *options,
        "-protocol_whitelist",
        "file",
        "-f",
        kind,
        "-codec_whitelist",
        "h264,ffv1",
        "-threads",
        "1",
        "-i",
        f"/proc/{os.getpid()}/fd/{descriptor}",
        "-an",
        "-sn",
        "-dn",
        *output,
        "-",
    ]
    cpu_s = _MIN_CPU_S + os.fstat(descriptor).st_size // _BYTES_PER_CPU_S
    try:
        return _core.run_process([os.fsencode(word) for word in command], _SILENCE_S, cpu_s, _MEMORY, max_bytes)
    except RuntimeError as error:
        raise RuntimeError(f"{video}: ffmpeg cannot decode it: {error}") from None
