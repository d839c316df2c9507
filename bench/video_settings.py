# SPDX-License-Identifier: Apache-2.0
"""Settings of x264 for recordings: size, quality, time of encoding, and time of decoding a frame at random. The table of
docs/formats.md.

    python bench/video_settings.py

The four videos of two episodes of `pick` (two cameras of 640x368) are recorded with crf 0 and encoded with each setting on one
thread. CPU time of encoding includes the start of ffmpeg. Decoding is that of `mjs.Dataset` without its cache, for both cameras,
least of three runs.
"""

import pathlib
import re
import resource
import statistics
import subprocess
import tempfile
import time
from fractions import Fraction

import numpy as np

import mjsense as mjs
from mjsense.dataset.video_decoder import Decoder, Packets, open_container

SETTINGS = {
    "crf 24, B-frames, key frame every 250 (an earlier default)": "-preset veryfast -crf 24",
    "crf 25, no B-frames, 20 (an earlier default)": "-preset veryfast -crf 25 -bf 0 -g 20",
    "crf 25, no B-frames, 10": "-preset veryfast -crf 25 -bf 0 -g 10",
    "crf 25, no B-frames, 20, no deblocking": "-preset veryfast -crf 25 -bf 0 -g 20 -x264-params no-deblock=1",
    "crf 25, no B-frames, 20, no CABAC": "-preset veryfast -crf 25 -bf 0 -g 20 -x264-params cabac=0",
    "**crf 25, no B-frames, 20, fastdecode**": "-preset veryfast -crf 25 -bf 0 -g 20 -tune fastdecode",
    "crf 25, no B-frames, 10, fastdecode": "-preset veryfast -crf 25 -bf 0 -g 10 -tune fastdecode",
    "MolmoSpaces: medium, crf 25": "-preset medium -crf 25",
}


def ffmpeg(*options: str) -> str:
    """What it says."""
    return subprocess.run(["ffmpeg", "-hide_banner", "-y", *options], check=True, capture_output=True, text=True).stderr


def decoded(folder: pathlib.Path) -> list[pathlib.Path]:
    """Frames of the videos in ``folder/out``, uncompressed."""
    raw = []
    for i, video in enumerate(sorted((folder / "out").rglob("*.mp4"))):
        raw.append(folder / f"{i}.y4m")
        ffmpeg("-i", str(video), "-pix_fmt", "yuv420p", str(raw[-1]))
    return raw


def random_ms(path: pathlib.Path) -> float:
    with open_container(path) as container:
        stream = container.streams.video[0]
        frames, size = stream.frames, (stream.width, stream.height)
    decoder = Decoder(packets := Packets(path, Fraction(500, 33), frames, size, ""))
    order = np.random.default_rng(0).permutation(len(packets.sizes))
    times = []
    for _ in range(3):
        begun = time.thread_time()
        for t in order:
            decoder.until(int(t))
        times.append(1e3 * (time.thread_time() - begun) / len(order))
    return min(times)


def main() -> None:
    print(
        "| setting | bytes per frame | CPU ms per frame | PSNR exo, wrist, dB | CPU ms of a random frame of both "
        "cameras |\n| --- | ---: | ---: | ---: | ---: |"
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        mjs.record("pick", out=folder / "out", episodes=2, num_worlds=2, crf=0, keep_failures=True)
        raw, out = decoded(folder), folder / "video.mp4"
        for name, setting in SETTINGS.items():
            frames, size, seconds, decoding, quality = 0, 0, 0.0, 0.0, []
            for video in raw:
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                ffmpeg("-threads", "1", "-i", str(video), "-c:v", "libx264", *setting.split(), "-threads", "1", str(out))
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                seconds += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
                said = ffmpeg("-i", str(out), "-i", str(video), "-lavfi", "psnr", "-f", "null", "-")
                frames += int(re.findall(r"frame=\s*(\d+)", said)[-1])
                quality.append(float(re.findall(r"average:([\d.]+)", said)[-1]))
                size += out.stat().st_size
                decoding += random_ms(out) / len(raw) * 2
            exo, wrist = (statistics.mean(quality[camera::2]) for camera in range(2))  # files are sorted by episode, then camera
            print(
                f"| {name} | {size / frames:,.0f} | {1e3 * seconds / frames:.1f} | {exo:.1f}, {wrist:.1f} | {decoding:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
