# SPDX-License-Identifier: Apache-2.0
"""Export to LeRobot; reading and writing: mjs.Dataset compared with LeRobot's loader, and the recorder's encoder with LeRobot's
writer.

    python bench/export.py [--width 640 --height 368] [--episodes 8] [--keep FOLDER] [--lerobot PYTHON] [--only-export]

A sample contains the state, the action and one frame of each of two cameras. Every case starts with empty caches. The two loaders
run in turn, each in a process of its own; LeRobot's environment is the one that tests/python/test_lerobot.py makes. Rates are per
second of wall clock, and in parentheses per second of CPU time, which other programs of the machine disturb less.
"""

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import mjsense as mjs
from mjsense.exporting import Source

ROOT = Path(__file__).parents[1]
REPEATS = 4  # of each episode in an export, whose beginning takes as long as 16 episodes
STREAMS = ["obs/agent/qpos", "actions/joint_pos", "obs/sensor_data/*"]


def read(root: Path, order: str, seconds: float, cache_mb: float) -> None:
    """Prints samples per second of mjs.Dataset."""
    dataset = mjs.Dataset(root, streams=STREAMS, cache_mb=cache_mb)
    dataset[0]  # opens the files
    indices = np.arange(len(dataset)) if order == "sequential" else np.random.default_rng(0).permutation(len(dataset))
    begun, cpu = time.perf_counter(), time.process_time()
    for n, i in enumerate(indices, 1):
        dataset[int(i)]
        if time.perf_counter() - begun > seconds:
            break
    print(n / (time.perf_counter() - begun), n / (time.process_time() - cpu))


def export(root: Path, out: Path) -> None:
    """Exports all episodes to the folder ``complete`` of ``out``, and those without idle steps, whose videos are encoded again,
    to ``trimmed``."""
    shutil.rmtree(out, ignore_errors=True)
    mjs.exporting.export_lerobot(root, out / "warm", episodes=[0])  # imports the libraries
    shutil.rmtree(out)
    for name, trim_idle, repeats in (("complete", False, REPEATS), ("trimmed", True, 1)):
        dataset = mjs.Dataset(root, trim_idle=trim_idle)
        begun, cpu = time.perf_counter(), time.process_time()
        mjs.exporting.export_lerobot(root, out / name, episodes=[*range(len(dataset.episodes))] * repeats, trim_idle=trim_idle)
        wall, cpu = time.perf_counter() - begun, time.process_time() - cpu
        cameras = sum(stream.kind == "video" and len(stream.shape) == 3 for stream in dataset.streams.values())
        images = len(dataset) * cameras * repeats
        print(f"export {name:29} {images / wall:9.0f} ({images / cpu:.0f}) frames/s")


def encode(root: Path, steps: int) -> float:
    """Steps per second of CPU time of ffmpeg as the recorder starts it, once per camera."""
    dataset = mjs.Dataset(root)
    episode, cpu, length = dataset.episodes[0], 0.0, 0
    for camera in Source(root).cameras:
        images = episode.video(camera)[:steps]
        length, height, width, _ = images.shape
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [
            "ffmpeg",
            "-v",
            "error",
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-s",
            f"{width}x{height}",
            "-r",
            str(dataset.fps),
            "-i",
            "-",
            "-c:v",
            "libx264",
            "-preset",
            "veryfast",
            "-crf",
            "24",
            "-threads",
            "1",
            "-pix_fmt",
            "yuv420p",
            "-f",
            "mp4",
            "-movflags",
            "frag_keyframe+empty_moov",
            "-y",
            "/dev/null",
        ]
        subprocess.run(command, input=images.tobytes(), check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return length / cpu


def compare_writers(root: Path, exported: Path, folder: Path, python: str, steps: int) -> None:
    print(f"write       recorder's ffmpeg      {encode(root, steps):7.1f} steps per CPU second")
    for mode in ("png", "av1", "h264"):
        out = folder / f"written_{mode}"
        shutil.rmtree(out, ignore_errors=True)
        words = [python, str(ROOT / "bench/peers/lerobot_writer.py"), str(exported), str(out), mode, str(steps)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        print(f"write       LeRobot, {mode:13} {float(done.stdout.split()[-1]):7.1f} steps per CPU second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=368)
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=10, help="maximum time of one case")
    parser.add_argument("--cache-mb", type=float, default=512, help="cache of mjs.Dataset; LeRobot has none")
    parser.add_argument("--steps", type=int, default=60, help="steps that are written")
    parser.add_argument("--keep", help="folder of the recording, which is used again if it exists")
    parser.add_argument("--lerobot", default=str(ROOT / "build/lerobot_0.4.4/bin/python"), help="Python of LeRobot's environment")
    parser.add_argument("--only-export", action="store_true", help="measure the export only")
    parser.add_argument("--read", nargs=2, help=argparse.SUPPRESS)  # a process of one case
    args = parser.parse_args()
    if args.read:
        read(Path(args.read[0]), args.read[1], args.seconds, args.cache_mb)
        return
    with tempfile.TemporaryDirectory() as folder:
        root, out = Path(args.keep or folder, "recording"), Path(args.keep or folder, "lerobot")
        if not list(root.glob("house_*/*.h5")):
            mjs.record(
                "pick", out=root, episodes=args.episodes, width=args.width, height=args.height, keep_failures=True, num_worlds=2
            )
        export(root, out)
        if args.only_export:
            return
        loaders = {
            name: [sys.executable, __file__, "--seconds", str(args.seconds), "--cache-mb", str(cache_mb), "--read", str(root)]
            for name, cache_mb in (("mjs.Dataset", args.cache_mb), ("mjs.Dataset, small cache", 8))
        } | {
            "LeRobot": [args.lerobot, str(ROOT / "bench/peers/lerobot_loader.py"), str(out / "complete")],
        }
        for order in ("sequential", "random"):
            for name, command in loaders.items():
                words = [*command, order, *([str(args.seconds)] if name == "LeRobot" else [])]
                done = subprocess.run(words, capture_output=True, text=True, check=True)
                wall, cpu = map(float, done.stdout.split()[-2:])
                print(f"{order:11} {name:24} {wall:9.1f} ({cpu:.1f}) samples/s")
        compare_writers(root, out / "complete", root.parent, args.lerobot, args.steps)


if __name__ == "__main__":
    main()
