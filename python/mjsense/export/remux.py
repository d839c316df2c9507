# SPDX-License-Identifier: Apache-2.0
"""Concatenation of videos without encoding them again."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

from mjsense.dataset.video_decoder import CODECS, open_container
from mjsense.export.output import needs


class Concatenation:
    """An MP4 file that contains the packets of other MP4 files one after another. Frame ``n`` has the time ``n / fps``.

    ``add`` returns False if a video does not fit: the codec's parameters (SPS and PPS) of the others differ.
    """

    def __init__(self, path: Path, fps: Fraction) -> None:
        self.frames = 0
        self.bytes = 0
        self._path, self._fps = path, fps
        self._file: Any = None
        self._parameters: Any = None

    def close(self) -> None:
        """Completes the file."""
        if self._file is not None:
            self._file.close()

    def add(self, path: Path, frames: int) -> bool:
        """Appends the video ``path``, which must have this number of frames."""
        av = needs("av")
        with open_container(path, codecs=f"{CODECS},hevc") as video:  # depth is encoded with hevc for LeRobot
            stream = video.streams.video[0]
            packets = [packet for packet in video.demux(stream) if packet.dts is not None]
            if len(packets) != frames:
                raise ValueError(f"{path} has {len(packets)} frames, but its episode has {frames} observations; `mjsense verify` checks the files")
            tick = 1 / (self._fps * stream.time_base)  # of one frame
            if tick.denominator != 1 or min(packet.pts for packet in packets) != 0:
                raise ValueError(f"{path}: its times are not those of {self._fps} frames per second from 0; `mjsense verify` checks the files")
            # Frames are decoded up to `delay` positions before they are shown; dts is therefore negative at the start.
            delay = -packets[0].dts
            parameters = (bytes(stream.codec_context.extradata or b""), stream.time_base, stream.width, stream.height, delay)
            if self._file is None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._file = av.open(str(self._path), "w", format="mp4")
                self._out = self._file.add_stream_from_template(stream)
                self._out.time_base = stream.time_base
                self._parameters = parameters
            elif parameters != self._parameters:
                return False
            start = self.frames * tick.numerator
            for n, packet in enumerate(packets):
                packet.stream = self._out
                packet.pts += start
                packet.dts = start + n * tick.numerator - delay
                packet.duration = tick.numerator
                self.bytes += packet.size
                self._file.mux(packet)
        self.frames += len(packets)
        return True
