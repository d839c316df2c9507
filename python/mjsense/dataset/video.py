# SPDX-License-Identifier: Apache-2.0
"""Frames of videos by their number: with PyAV if it is installed, otherwise with the ffmpeg program."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense._arguments import checked
from mjsense.dataset.cache import Cache
from mjsense.ffmpeg import use_installed_ffmpeg

_CHUNK = 64  # frames that one start of ffmpeg decodes; a start costs as much as about 50 frames of 640x368
_OPEN_DECODERS = 16
_SKIP = 16  # frames that are decoded rather than skipped by a seek


@dataclass(frozen=True)
class VideoInfo:
    """Data of a video that the HDF5 file states."""

    path: Path
    frames: int
    width: int
    height: int
    encoding: str
    """``rgb``, ``depth16`` or ``molmospaces_red_green``."""
    metres_per_unit: float
    fps: Fraction

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.height, self.width, 3) if self.encoding == "rgb" else (self.height, self.width)

    @property
    def pixel_format(self) -> str:
        return "gray16le" if self.encoding == "depth16" else "rgb24"


def decoded(info: VideoInfo, pixels: np.ndarray) -> np.ndarray:
    """Values of a picture: uint8 [H, W, 3] of rgb, float32 [H, W] m of depth."""
    pixels = pixels[: info.height, : info.width]  # odd sizes are stored with one column or row more
    if info.encoding == "rgb":
        return np.ascontiguousarray(pixels)
    if info.encoding == "depth16":
        return pixels * np.float32(info.metres_per_unit)
    code = (pixels[..., 0].astype(np.float32) * 256) + pixels[..., 1]
    return np.where(code > 0, (code - 1) / np.float32(65534) * np.float32(0.5) + np.float32(0.05), np.float32(0))


class _AvDecoder:
    """An open video. It decodes in one thread: DataLoader's workers run in parallel, and a fork copies no threads."""

    def __init__(self, info: VideoInfo) -> None:
        import av  # pyright: ignore[reportMissingImports]

        self._fps = info.fps
        self._container = av.open(str(info.path))
        self._stream = self._container.streams.video[0]
        self._stream.codec_context.thread_count = 1
        assert self._stream.time_base is not None  # only streams that are being written have none
        self._time_base = self._stream.time_base
        self._frames = self._container.decode(self._stream)
        self._next = 0

    def frames_until(self, index: int) -> Iterator[tuple[int, Any]]:
        """Decoded frames up to the frame ``index``, with their numbers: from the current position or from the key frame before it."""
        if not self._next <= index < self._next + _SKIP:
            self._container.seek(round(index / self._fps / self._time_base), stream=self._stream)
            self._frames = self._container.decode(self._stream)
        for frame in self._frames:
            number = round((frame.pts or 0) * self._time_base * self._fps)
            self._next = number + 1
            yield number, frame
            if number >= index:
                return


def _have_av() -> bool:
    try:
        import av  # pyright: ignore[reportMissingImports]
    except ImportError:
        return False
    return int(av.__version__.split(".")[0]) >= 18  # to_ndarray(threads=...)


class FrameReader:
    """Frames of all videos of a data set, with a cache of decoded ones."""

    def __init__(self, cache: Cache) -> None:
        self._cache = cache
        self._decoders = Cache(_OPEN_DECODERS, per_process=True)
        self._av = _have_av()

    def frame(self, info: VideoInfo, index: int) -> np.ndarray:
        with self._cache.lock:
            found = self._cache.find((info.path, index))
            if found is None:
                found = self._decode_av(info, index) if self._av else self._decode_program(info, index)
        # One thread: with more, a frame keeps the converter's threads, and its copy in a forked process waits for them forever.
        return decoded(info, found if isinstance(found, np.ndarray) else found.to_ndarray(format=info.pixel_format, threads=1))

    def _decode_av(self, info: VideoInfo, index: int) -> Any:
        decoder = self._decoders.get(info.path, lambda: (_AvDecoder(info), 1))
        found = None
        # Frames stay in the codec's format, which is half as large as rgb; only requested ones are converted.
        for number, frame in decoder.frames_until(index):
            self._cache.add((info.path, number), frame, sum(plane.buffer_size for plane in frame.planes))
            found = frame if number == index else None
        if found is None:
            raise self._missing(info, index)
        return found

    def _decode_program(self, info: VideoInfo, index: int) -> Any:
        use_installed_ffmpeg()
        program = os.environ.get("MJSENSE_FFMPEG") or shutil.which("ffmpeg")
        if not program:
            raise RuntimeError(f"Reading the video {info.path} needs PyAV or ffmpeg: pip install 'mjsense[dataset]'")
        depth = info.encoding == "depth16"
        odd = 1 if info.encoding == "rgb" else 0
        shape = (info.height + (info.height & odd), info.width + (info.width & odd)) + (() if depth else (3,))
        first = index - index % _CHUNK
        # A tenth of a frame early: ffmpeg drops the frames before this time, and the file's times are rounded.
        at = ["-ss", f"{float((first - Fraction(1, 10)) / info.fps):.6f}"] if first else []
        command = [program, "-nostdin", "-v", "error", *at, "-i", f"file:{info.path}", "-frames:v", str(_CHUNK), "-f", "rawvideo",
                   "-pix_fmt", info.pixel_format, "-"]  # fmt: skip
        done = subprocess.run(command, capture_output=True)
        size = int(np.prod(shape)) * (2 if depth else 1)
        if done.returncode or len(done.stdout) % size:
            raise RuntimeError(f"{info.path}: ffmpeg cannot decode it: {done.stderr.decode(errors='replace').strip()}")
        found = None
        for i in range(len(done.stdout) // size):
            pixels = np.frombuffer(done.stdout, "<u2" if depth else np.uint8, int(np.prod(shape)), i * size).reshape(shape).copy()
            self._cache.add((info.path, first + i), pixels, size)
            found = pixels if first + i == index else found
        if found is None:
            raise self._missing(info, index)
        return found

    def _missing(self, info: VideoInfo, index: int) -> Exception:
        return RuntimeError(f"{info.path} has no frame {index}; its episode has {info.frames} observations (`mjsense verify` checks the files)")


@checked
class Video:
    """Frames of one camera in one episode, decoded when they are indexed: ``video[3]``, ``video[-1]``, ``video[10:20]``.

    A frame is uint8 [H, W, 3] for rgb and float32 [H, W] in metres for depth; a slice has one more dimension in front.
    In depth images 0 means no measurement, and the largest value (13.107 m by default) that far or farther.
    """

    def __init__(self, info: VideoInfo, reader: FrameReader) -> None:
        self._info, self._reader = info, reader

    @property
    def path(self) -> Path:
        """The file."""
        return self._info.path

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of ``video[:]``."""
        return (self._info.frames, *self._info.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """uint8 for rgb, float32 for depth."""
        return np.dtype(np.uint8 if self._info.encoding == "rgb" else np.float32)

    @property
    def fps(self) -> Fraction:
        """Frames per second."""
        return self._info.fps

    def __len__(self) -> int:
        return self._info.frames

    def __getitem__(self, index: int | slice) -> np.ndarray:
        if isinstance(index, slice):
            frames = np.empty((len(range(*index.indices(len(self)))), *self._info.shape), self.dtype)
            for i, t in enumerate(range(*index.indices(len(self)))):
                frames[i] = self._reader.frame(self._info, t)
            return frames
        t = index + len(self) if index < 0 else index
        if not 0 <= t < len(self):
            raise IndexError(f"{self._info.path} has {len(self)} frames, not {index}")
        return self._reader.frame(self._info, int(t))

    def __repr__(self) -> str:
        return f"Video({self._info.path.name!r}, {self.dtype} {list(self.shape)})"
