# SPDX-License-Identifier: Apache-2.0
"""Decoding of single frames with PyAV: from a table of the packets of a file, without a demuxer."""

from __future__ import annotations

import threading
from bisect import bisect_right
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

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

    # A converter takes 0.1 ms to create, as long as it needs for an image of 300 x 300 pixels, so each thread keeps one for each size.
    key = str((frame.width, frame.height, frame.format.name, pixel_format))
    converter = vars(_converters).get(key) or vars(_converters).setdefault(key, VideoReformatter())
    # One thread: a copy of a converter in a forked process would wait for the others forever.
    return converter.reformat(frame, format=pixel_format, threads=1).to_ndarray()


class Packets:
    """Where the packets of a video lie in its file, in the order of decoding.

    Opening a video with a demuxer and seeking in it costs more than decoding ten frames of 128x96. Reading the table costs as much once;
    a later sample reads only the bytes from the key frame to its frame.
    """

    def __init__(self, path: Path, fps: Fraction) -> None:
        import av  # pyright: ignore[reportMissingImports]

        self.path = path
        self.offsets: list[int] = []
        self.sizes: list[int] = []
        self.frames: list[int] = []
        """Number of the frame that each packet contains."""
        self.keys: list[int] = []
        """Packets that can be decoded without the ones before."""
        self.key_frames: list[int] = []
        """Their frames."""
        data = path.read_bytes()
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            context = stream.codec_context
            self.codec, self.extradata, self.size = context.name, context.extradata, (context.width, context.height)
            for packet in container.demux(stream):
                if not packet.size or packet.pts is None or packet.pos is None or stream.time_base is None:
                    continue  # the end of the stream
                # The position is that of the packet's bytes in MP4, and a few bytes before them in Matroska.
                offset = data.find(bytes(packet), packet.pos)
                if offset < 0:
                    raise RuntimeError(f"{path}: the file does not contain the bytes of its packet {len(self.sizes)}")
                frame = round(packet.pts * stream.time_base * fps)
                if packet.is_keyframe:
                    self.keys.append(len(self.sizes))
                    self.key_frames.append(frame)
                self.offsets.append(offset)
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
    """A codec at a position of a video. It decodes in one thread: DataLoader's workers run in parallel, and a fork copies no threads."""

    def __init__(self, packets: Packets) -> None:
        import av  # pyright: ignore[reportMissingImports]

        self._packet: Any = av.Packet
        self._packets = packets
        context: Any = av.CodecContext.create(packets.codec, "r")
        context.extradata = packets.extradata
        context.width, context.height = packets.size
        context.thread_count = 1
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
        with open(packets.path, "rb", buffering=0) as file:
            # Without B-frames, the packet of a frame is the one with its number, and its frame is returned at once.
            while self._next < len(packets.sizes):
                first = self._next
                last = max(first, min(frame + first - packets.frames[first], len(packets.sizes) - 1))
                file.seek(packets.offsets[first])
                data = memoryview(file.read(packets.offsets[last] + packets.sizes[last] - packets.offsets[first]))
                for n in range(first, last + 1):
                    begin = packets.offsets[n] - packets.offsets[first]
                    packet = self._packet(data[begin : begin + packets.sizes[n]])
                    packet.pts = packets.frames[n]
                    for decoded in decode(packet):
                        found.append((decoded.pts, decoded))
                    self._next = n + 1
                    if found and found[-1][0] >= frame:
                        self._newest = found[-1][0]
                        return found
            found += [(decoded.pts, decoded) for decoded in decode(None)]
        return found
