# SPDX-License-Identifier: Apache-2.0
"""Concatenation of videos without encoding them again."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

from mjsense.core.counted import counted
from mjsense.dataset.video_decoder import CODECS, open_container
from mjsense.exporting.output import needs


def ends_with_last_frame(path: Path) -> bool:
    """Whether the frame that is shown last is also the last one in the file, so that no other frame needs it to be decoded."""
    with open_container(path) as video:
        stream = video.streams.video[0]
        if not stream.codec_context.has_b_frames:
            return True
        times = [packet.pts for packet in video.demux(stream) if packet.pts is not None]
        return times[-1] == max(times)


class Concatenation:
    """An MP4 file that contains the packets of other MP4 files one after another. Frame ``n`` has the time ``n / fps``, whatever
    the rate of the other files is."""

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

    def add(self, path: Path, fps: Fraction, frames: int, kept: int) -> bool:
        """Appends the first frames of a video. Returns False if it does not fit: the codec's parameters (SPS and PPS) of the
        others differ.

        Args:
            path: The video, which must have the rate ``fps`` and this number of frames.
            kept: Number of frames to append, ``frames`` or one less.
        """
        av = needs("av")
        with open_container(path, codecs=f"{CODECS},hevc") as video:  # depth is encoded with hevc for LeRobot
            stream = video.streams.video[0]
            packets = [packet for packet in video.demux(stream) if packet.dts is not None]
            if len(packets) != frames:
                raise ValueError(
                    f"{path} has {counted(len(packets), 'frame')}, but its episode has "
                    f"{counted(frames, 'observation')}; `mjsense verify` "
                    "checks the files"
                )
            tick = 1 / (fps * stream.time_base)  # of one frame
            if tick.denominator != 1 or sorted(packet.pts for packet in packets) != [n * tick.numerator for n in range(frames)]:
                raise ValueError(
                    f"{path}: its times are not those of {fps} frames per second from 0; `mjsense verify` checks the files"
                )
            if kept < frames and packets[-1].pts != (frames - 1) * tick.numerator:
                raise ValueError(f"{path}: its last frame cannot be left out, because others need it")
            # Frames are decoded up to `delay` positions before they are shown; dts is therefore negative at the start.
            delay = Fraction(-packets[0].dts, tick.numerator)
            base = stream.time_base if fps == self._fps else 1 / (1000 * self._fps)
            parameters = (bytes(stream.codec_context.extradata or b""), base, stream.width, stream.height, delay)
            if self._file is None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._file = av.open(str(self._path), "w", format="mp4")
                self._out = self._file.add_stream_from_template(stream)
                self._out.time_base = base
                self._parameters = parameters
            elif parameters != self._parameters:
                return False
            ours = int(1 / (self._fps * base))  # ticks of one frame in this file
            for n, packet in enumerate(packets[:kept]):
                at = self.frames + packet.pts // tick.numerator
                packet.stream = self._out
                packet.time_base = base
                packet.pts = at * ours
                packet.dts = int((self.frames + n - delay) * ours)
                packet.duration = ours
                self.bytes += packet.size
                self._file.mux(packet)
        self.frames += kept
        return True
