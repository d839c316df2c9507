# SPDX-License-Identifier: Apache-2.0
"""Compares video encoders with the one that recordings use (libx264, veryfast, crf 25, no B-frames, a key frame every 20 frames,
tuned for fast decoding) in CPU time at similar quality and size.

Four videos of the default pick task (two cameras in two episodes) are recorded losslessly and encoded by each of ffmpeg's
encoders on one thread, with settings that give about the same PSNR. CPU time includes the start of ffmpeg and reading the frames,
which is the same for all.
"""

from __future__ import annotations

import pathlib
import re
import resource
import statistics
import subprocess
import sys
import tempfile

from harness import MJSENSE, Row, report
from video_settings import decoded, ffmpeg

RUNS = 5
OURS = ("-c:v", "libx264", "-preset", "veryfast", "-crf", "25", "-bf", "0", "-g", "20", "-tune", "fastdecode")
OTHERS = {
    "libx264, superfast, crf 28": ("-c:v", "libx264", "-preset", "superfast", "-crf", "28"),
    "libx265, ultrafast, crf 18": (
        "-c:v",
        "libx265",
        "-preset",
        "ultrafast",
        "-crf",
        "18",
        "-x265-params",
        "pools=1:frame-threads=1",
    ),
    "SVT-AV1, preset 10, crf 35": ("-c:v", "libsvtav1", "-preset", "10", "-crf", "35", "-svtav1-params", "lp=1"),
    "SVT-AV1, preset 12, crf 28": ("-c:v", "libsvtav1", "-preset", "12", "-crf", "28", "-svtav1-params", "lp=1"),
    "libvpx-vp9, realtime 8, crf 28": (
        "-c:v",
        "libvpx-vp9",
        "-deadline",
        "realtime",
        "-cpu-used",
        "8",
        "-crf",
        "28",
        "-b:v",
        "0",
    ),
    "mpeg4, q 4": ("-c:v", "mpeg4", "-q:v", "4"),
    "mjpeg, q 3": ("-c:v", "mjpeg", "-q:v", "3", "-pix_fmt", "yuvj420p"),
}


def raw_videos(folder: pathlib.Path) -> list[pathlib.Path]:
    record = [
        *MJSENSE,
        "record",
        "pick",
        "--worlds",
        "2",
        "--episodes",
        "2",
        "--crf",
        "0",
        "--out",
        folder / "out",
        "-q",
        "--no-sheet",
    ]
    subprocess.run(record, check=True, stdout=subprocess.DEVNULL)
    return decoded(folder)


def encode(raw: list[pathlib.Path], options: tuple[str, ...], out: pathlib.Path) -> tuple[float, float, float]:
    """CPU ms per frame, bytes per frame, and PSNR in dB."""
    seconds, frames, size, quality = 0.0, 0, 0, []
    for video in raw:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        ffmpeg("-threads", "1", "-i", str(video), *options, "-threads", "1", str(out))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        size += out.stat().st_size
        said = ffmpeg("-i", str(out), "-i", str(video), "-lavfi", "psnr", "-f", "null", "-")
        frames += int(re.findall(r"frame=\s*(\d+)", said)[-1])
        quality.append(float(re.findall(r"average:([\d.]+)", said)[-1]))
    return 1e3 * seconds / frames, size / frames, statistics.mean(quality)


def main() -> None:
    rows = []
    known = subprocess.run(["ffmpeg", "-hide_banner", "-encoders"], check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        raw = raw_videos(folder)
        for name, options in OTHERS.items():
            if f" {options[1]} " not in known:
                print(f"encoders: {options[1]} skipped: this ffmpeg does not have it", file=sys.stderr)
                continue
            rounds = [[encode(raw, setting, folder / "video.mp4") for setting in (OURS, options)] for _ in range(RUNS)]
            ours, other = ([statistics.median(r[i][k] for r in rounds) for k in range(3)] for i in range(2))
            rows.append(Row(name, ours[0], "CPU ms per frame", other[0], "the named encoder", higher_is_better=False))
            rows.append(Row(name, ours[1], "bytes a frame", other[1], "the named encoder", higher_is_better=False))
            rows.append(Row(f"- {name}", other[2] - ours[2], "dB difference"))
            print(rows[-3:], file=sys.stderr)
    report("Encoders compared with libx264, veryfast, crf 25, no B-frames, key frames every 20", rows)


if __name__ == "__main__":
    main()
