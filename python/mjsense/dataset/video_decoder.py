# SPDX-License-Identifier: Apache-2.0
"""Decoding of single frames with PyAV: from a table of the packets of a file, without a demuxer."""

from __future__ import annotations

import threading
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.optional import optional
from mjsense.dataset.places import PlainFile, open_plain, printable

CODECS = "h264,ffv1"
"""Codecs of recorded videos. No other decoder gets to see the file of a recording."""
_MARGIN = 64  # pixels by which a decoder may exceed the stated size
_NEAR = 4096  # bytes between the position that a demuxer states and the bytes of the packet, at most
_FLUSH = 1 << 62  # as the newest frame: every frame is before it, so the next call begins at a key frame


def have_av() -> bool:
    try:
        import av  # pyright: ignore[reportMissingImports]
    except ImportError:
        return False
    return int(av.__version__.split(".")[0]) >= 18  # to_ndarray(threads=...)


_converters = threading.local()


def to_array(frame: Any, pixel_format: str) -> np.ndarray:
    """The pixels of a decoded frame."""
    from av.video.reformatter import VideoReformatter  # pyright: ignore[reportMissingImports]

    # A converter takes 0.1 ms to create, as long as it needs for an image of 300 x 300 pixels, so each thread keeps one for each
    # size.
    key = str((frame.width, frame.height, frame.format.name, pixel_format))
    converter = vars(_converters).get(key) or vars(_converters).setdefault(key, VideoReformatter())
    # One thread: a copy of a converter in a forked process would wait for the others forever.
    return converter.reformat(frame, format=pixel_format, threads=1).to_ndarray()


def container_format(path: Path) -> str:
    """The demuxer of a video file. It is chosen by the name, never by the content: a playlist would open other files."""
    return "matroska" if path.suffix == ".mkv" else "mov"


def check_sum(file: PlainFile, stated: str, what: str) -> None:
    """Compares a file with its checksum, and goes to its start. An empty checksum is that of an older recording, which has
    none."""
    if stated:
        crc = 0
        while piece := file.read(1 << 20):
            crc = zlib.crc32(piece, crc)
        file.seek(0)
        if f"{crc:08x}" != stated:
            raise RuntimeError(
                f"{what} differs from what was recorded: its checksum is {crc:08x}, not {printable(stated[:20])}; "
                "`mjsense verify` lists what is damaged"
            )


@contextmanager
def open_container(path: Path, crc: str = "", codecs: str = CODECS) -> Iterator[Any]:
    """PyAV's container of a video file, which can open nothing else.

    Args:
        crc: Checksum with which the file is compared first.
        codecs: Codecs that the file may have, separated by commas.
    """
    av = optional("av", "dataset", "Reading videos")
    with open_plain(path) as file:
        check_sum(file, crc, str(path))
        try:
            with av.open(
                file, format=container_format(path), options={"codec_whitelist": codecs, "protocol_whitelist": "none"}
            ) as container:
                if not container.streams.video or container.streams.video[0].codec_context.name not in codecs.split(","):
                    raise RuntimeError(f"{path}: contains no video of {codecs.replace(',', ' or ')}")
                yield container
        except av.FFmpegError as error:
            raise RuntimeError(f"{path}: not a video that can be read: {error.strerror}") from None


class Packets:
    """Where the packets of a video lie in its file, in the order of decoding.

    Opening a video with a demuxer and seeking in it costs more than decoding ten frames of 128x96. Reading the table costs as
    much once; a later sample reads only the bytes from the key frame to its frame.
    """

    def __init__(self, path: Path, fps: Fraction, frames: int, size: tuple[int, int], crc: str) -> None:
        self.path = path
        self.offsets: list[int] = []
        self.sizes: list[int] = []
        self.frames: list[int] = []
        """Number of the frame that each packet contains."""
        self.keys: list[int] = []
        """Packets that can be decoded without the ones before."""
        self.key_frames: list[int] = []
        """Their frames."""
        self.exact = True
        """Whether each frame is exactly at its time. Matroska rounds times to milliseconds."""
        with open_container(path, crc) as container, open_plain(path) as file:
            self.identity = file.identity
            stream = container.streams.video[0]
            context = stream.codec_context
            self.codec, self.extradata, self.size = context.name, context.extradata, (context.width, context.height)
            if any(got not in (stated, stated + stated % 2) for got, stated in zip(self.size, size)):
                raise RuntimeError(
                    f"{path}: its images have {self.size[0]} x {self.size[1]} pixels, the recording states {size[0]} x {size[1]}"
                )
            stored = 0
            for packet in container.demux(stream):
                if not packet.size or packet.pts is None or packet.pos is None or stream.time_base is None:
                    continue  # the end of the stream
                if len(self.sizes) > 2 * frames:
                    raise RuntimeError(
                        f"{path}: has more than {2 * frames} frames; its episode has {counted(frames, 'observation')}"
                    )
                # The position is that of the packet's bytes in MP4, and a few bytes before them in Matroska.
                file.seek(max(0, packet.pos))
                offset = file.read(packet.size + _NEAR).find(bytes(packet))
                if offset < 0:
                    raise RuntimeError(f"{path}: the file does not contain the bytes of its packet {len(self.sizes)}")
                at = packet.pts * stream.time_base * fps
                frame = round(at)
                stored += packet.size
                if stored > file.size or not -frames <= frame <= 2 * frames:
                    why = f"the time of frame {frame}" if stored <= file.size else f"packets of {stored} bytes in {file.size}"
                    raise RuntimeError(f"{path}: has {why}; its episode has {counted(frames, 'observation')}")
                self.exact &= at == frame
                if packet.is_keyframe:
                    self.keys.append(len(self.sizes))
                    self.key_frames.append(frame)
                self.offsets.append(max(0, packet.pos) + offset)
                self.sizes.append(packet.size)
                self.frames.append(frame)
        if not self.keys or self.keys[0]:
            raise RuntimeError(f"{path}: the video does not begin with a key frame")

    @property
    def bytes(self) -> int:
        """Approximate size of the table in memory."""
        return 100 * len(self.sizes)

    def key_before(self, frame: int) -> int:
        """The key packet from which a frame is decoded."""
        return self.keys[max(0, bisect_right(self.key_frames, frame) - 1)]


class Decoder:
    """A codec at a position of a video. It decodes in one thread: DataLoader's workers run in parallel, and a fork copies no
    threads."""

    def __init__(self, packets: Packets) -> None:
        av = optional("av", "dataset", "Reading videos")
        self._packet: Any = av.Packet
        self._error: Any = av.FFmpegError
        self._packets = packets
        context: Any = av.CodecContext.create(packets.codec, "r")
        context.extradata = packets.extradata
        context.width, context.height = packets.size
        context.thread_count = 1
        # A frame may state another size than the file.
        context.options = {"max_pixels": str((packets.size[0] + _MARGIN) * (packets.size[1] + _MARGIN))}
        self._context = context
        self._next = 0  # packet
        self._newest = -1  # frame

    def until(self, frame: int) -> list[tuple[int, Any]]:
        """Decoded frames with their numbers, up to the wanted one: from the current position or from the key frame before it.

        The list does not contain the wanted frame if the file lacks it.
        """
        packets, decode = self._packets, self._context.decode
        key = packets.key_before(frame)
        if not key <= self._next or frame <= self._newest:
            self._context.flush_buffers()
            self._next = key
        self._newest = _FLUSH  # if decoding fails
        found: list[tuple[int, Any]] = []
        with open_plain(packets.path) as file:
            if file.identity != packets.identity:
                raise RuntimeError(f"{packets.path}: changed while it was being read")
            # Without B-frames, the packet of a frame is the one with its number, and its frame is returned at once.
            while self._next < len(packets.sizes):
                n = self._next
                file.seek(packets.offsets[n])
                packet = self._packet(file.read(packets.sizes[n]))
                packet.pts = packets.frames[n]
                try:
                    found += [(decoded.pts, decoded) for decoded in decode(packet)]
                except self._error as error:
                    raise RuntimeError(
                        f"{packets.path}: the frame {packets.frames[n]} cannot be decoded: {error.strerror}"
                    ) from None
                self._next = n + 1
                if found and found[-1][0] >= frame:
                    self._newest = found[-1][0]
                    return found
            found += [(decoded.pts, decoded) for decoded in decode(None)]
        return found
