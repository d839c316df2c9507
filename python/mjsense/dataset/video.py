# SPDX-License-Identifier: Apache-2.0
"""Frames of videos by their number: with PyAV if it is installed, otherwise with the ffmpeg program."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.dataset.cache import Cache
from mjsense.dataset.places import open_plain
from mjsense.dataset.video_decoder import Decoder, Packets, check_sum, have_av, to_array
from mjsense.recording.ffmpeg import frames_of

_CHUNK_BYTES = 1 << 28  # of the frames that one start of ffmpeg decodes, at most
_CHUNK = 64  # frames that one start of ffmpeg decodes; a start costs as much as about 50 frames of 640x368
_OPEN_DECODERS = 16
_LARGE_IMAGE = 100_000  # pixels; with smaller images, starting threads costs more than they save


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
    crc: str = ""
    """Checksum of the file; empty: unknown."""

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.height, self.width, 3) if self.encoding == "rgb" else (self.height, self.width)

    @property
    def pixel_format(self) -> str:
        return "gray16le" if self.encoding == "depth16" else "rgb24"


def decoded(info: VideoInfo, pixels: np.ndarray) -> np.ndarray:
    """Values of a picture: uint8 [H, W, 3] of rgb, float32 [H, W] m of depth."""
    if not all(got in (stated, stated + stated % 2) for got, stated in zip(pixels.shape, (info.height, info.width))):
        raise RuntimeError(
            f"{info.path}: a frame has {pixels.shape[1]} x {pixels.shape[0]} pixels, the recording states "
            f"{info.width} x {info.height}"
        )
    pixels = pixels[: info.height, : info.width]  # odd sizes are stored with one column or row more
    if info.encoding == "rgb":
        return np.ascontiguousarray(pixels)
    if info.encoding == "depth16":
        return pixels * np.float32(info.metres_per_unit)
    code = (pixels[..., 0].astype(np.float32) * 256) + pixels[..., 1]
    return np.where(code > 0, (code - 1) / np.float32(65534) * np.float32(0.5) + np.float32(0.05), np.float32(0))


def _threads() -> int:
    """Number of threads. The workers of a DataLoader run in parallel already."""
    return 1 if multiprocessing.parent_process() else len(os.sched_getaffinity(0))


@dataclass
class _Job:
    """Frames of one video of a sample. It does not use the cache, because it may run in another thread."""

    info: VideoInfo
    indices: list[int]
    found: dict[int, Any]
    """Frames in the codec's format, which is half as large as rgb; only requested ones are converted."""
    missing: list[int]
    decoder: Decoder | None
    new: list[tuple[int, Any]] = field(default_factory=list)
    """All frames that were decoded, with their numbers."""

    def run(self) -> list[np.ndarray]:
        for t in self.missing:
            if self.found[t] is None:
                assert self.decoder is not None
                decoded_now = self.decoder.until(t)
                self.new += decoded_now
                self.found |= {number: frame for number, frame in decoded_now if number in self.found}
            if self.found[t] is None:
                raise _no_frame(self.info, t)
        return [self._image(self.found[t]) for t in self.indices]

    def _image(self, frame: Any) -> np.ndarray:
        return decoded(self.info, frame.copy() if isinstance(frame, np.ndarray) else to_array(frame, self.info.pixel_format))


def _no_frame(info: VideoInfo, index: int) -> Exception:
    return RuntimeError(
        f"{info.path} has no frame {index}; its episode has {counted(info.frames, 'observation')} (`mjsense verify` "
        "checks the files)"
    )


class FrameReader:
    """Frames of all videos of a data set, with a cache of decoded ones."""

    def __init__(self, cache: Cache, tables: Cache) -> None:
        self._cache, self._tables = cache, tables
        self._decoders = Cache(_OPEN_DECODERS, per_process=True)
        self._pools = Cache(1, per_process=True)
        self._av = have_av()

    def frame(self, info: VideoInfo, index: int) -> np.ndarray:
        return self.frames([(info, [index])])[0][0]

    def frames(self, wanted: Sequence[tuple[VideoInfo, list[int]]]) -> list[list[np.ndarray]]:
        """Frames of several videos. Those of different videos are decoded in parallel."""
        with self._cache.lock:
            jobs = [self._job(info, indices) for info, indices in wanted]
            work = [job for job in jobs if job.missing]
            if len(work) > 1 and work[0].info.width * work[0].info.height >= _LARGE_IMAGE and _threads() > 1:
                pool = self._pools.get("pool", lambda: (ThreadPoolExecutor(_threads()), 1))
                futures = [pool.submit(job.run) for job in jobs]
                wait(futures)  # also if one fails: no decoder is in use after this call
                results = [future.result() for future in futures]
            else:
                results = [job.run() for job in jobs]
            for job in work:
                size = sum(plane.buffer_size for plane in job.new[0][1].planes)
                for number, frame in job.new:
                    self._cache.add((job.info.path, number), frame, size)
        return results

    def _job(self, info: VideoInfo, indices: list[int]) -> _Job:
        found = {t: self._cache.find((info.path, t)) for t in indices}
        missing = sorted(t for t, frame in found.items() if frame is None)
        if missing and not self._av:
            for t in missing:  # one call decodes many frames
                frame = self._cache.find((info.path, t))
                found[t] = self._decode_program(info, t) if frame is None else frame
            missing = []
        decoder = self._decoders.get(info.path, lambda: (Decoder(self._packets(info)), 1)) if missing else None
        return _Job(info, indices, found, missing, decoder)

    def _packets(self, info: VideoInfo) -> Packets:
        def read() -> tuple[Packets, int]:
            packets = Packets(info.path, info.fps, info.frames, (info.width, info.height), info.crc)
            return packets, packets.bytes

        return self._tables.get(info.path, read)

    def _decode_program(self, info: VideoInfo, index: int) -> Any:
        depth = info.encoding == "depth16"
        odd = 1 if info.encoding == "rgb" else 0
        shape = (info.height + (info.height & odd), info.width + (info.width & odd)) + (() if depth else (3,))
        first = index - index % _CHUNK if np.prod(shape) * 2 * _CHUNK <= _CHUNK_BYTES else index
        # A tenth of a frame early: ffmpeg drops the frames before this time, and the file's times are rounded.
        at = ["-ss", f"{float((first - Fraction(1, 10)) / info.fps):.6f}"] if first else []
        size = int(np.prod(shape)) * (2 if depth else 1)
        count = max(1, min(_CHUNK, _CHUNK_BYTES // size))
        at += ["-max_pixels", str((info.width + 64) * (info.height + 64))]
        with open_plain(info.path) as file:
            self._tables.get((info.path, "sum"), lambda: (check_sum(file, info.crc, str(info.path)) or True, 1))
            raw = frames_of(
                info.path,
                file.fileno(),
                at,
                ["-frames:v", str(count), "-f", "rawvideo", "-pix_fmt", info.pixel_format],
                count * size,
            )
        if len(raw) % size:
            raise RuntimeError(f"{info.path}: ffmpeg cannot decode it: its images have another size than the recording states")
        found = None
        for i in range(len(raw) // size):
            pixels = np.frombuffer(raw, "<u2" if depth else np.uint8, int(np.prod(shape)), i * size).reshape(shape).copy()
            self._cache.add((info.path, first + i), pixels, size)
            found = pixels if first + i == index else found
        if found is None:
            raise _no_frame(info, index)
        return found


@checked
class Video:
    """Frames of one camera in one episode, decoded when they are indexed: ``video[3]``, ``video[-1]``, ``video[10:20]``.

    A frame is uint8 [H, W, 3] for rgb and float32 [H, W] in metres for depth; a slice has one more dimension in front.
    In depth images 0 means no measurement, and the largest value (13.107 m by default) that far or farther.
    """

    def __init__(self, info: VideoInfo, reader: FrameReader, kept: Sequence[int] | None = None) -> None:
        self._info, self._reader = info, reader
        self._kept = range(info.frames) if kept is None else kept  # frames of the file

    @property
    def path(self) -> Path:
        """The file."""
        return self._info.path

    def check(self) -> None:
        """Raises an error if the file is missing, is not a regular file, or differs from what was recorded: for a program that
        copies it."""
        with open_plain(self.path) as file:
            check_sum(file, self._info.crc, str(self.path))

    @property
    def trimmed(self) -> bool:
        """Whether frames of the file are left out, because the episode is trimmed."""
        return len(self) != self._info.frames

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of ``video[:]``."""
        return (len(self), *self._info.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """uint8 for rgb, float32 for depth."""
        return np.dtype(np.uint8 if self._info.encoding == "rgb" else np.float32)

    @property
    def fps(self) -> Fraction:
        """Frames per second."""
        return self._info.fps

    def __len__(self) -> int:
        return len(self._kept)

    def __getitem__(self, index: int | slice) -> np.ndarray:
        if isinstance(index, slice):
            frames = np.empty((len(range(*index.indices(len(self)))), *self._info.shape), self.dtype)
            for i, t in enumerate(range(*index.indices(len(self)))):
                frames[i] = self._reader.frame(self._info, self._kept[t])
            return frames
        t = index + len(self) if index < 0 else index
        if not 0 <= t < len(self):
            raise IndexError(f"{self._info.path} has {counted(len(self), 'frame')}, not {index}")
        return self._reader.frame(self._info, self._kept[int(t)])

    def __repr__(self) -> str:
        return f"Video({self._info.path.name!r}, {self.dtype} {list(self.shape)})"
