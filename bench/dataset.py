# SPDX-License-Identifier: Apache-2.0
"""Reading: samples per second of mjs.Dataset, random and sequential, with both cameras or without images.

    python bench/dataset.py [--width 640 --height 368] [--episodes 8] [--keep FOLDER]

A sample contains qpos, the next actions and, with images, one frame of each of two cameras. Every case starts with empty caches;
the order of the random samples is a permutation of all observations.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import mjsense as mjs
from mjsense.dataset import video

ROWS = ["obs/agent/qpos", "actions/joint_pos", "success"]


def samples_per_second(root: Path, streams: list[str], order: np.ndarray, seconds: float, cache_mb: float) -> tuple[float, float]:
    """By wall clock and by CPU time."""
    dataset = mjs.Dataset(root, streams=streams, cache_mb=cache_mb)
    begun, cpu = time.perf_counter(), time.process_time()
    for n, i in enumerate(order, 1):
        dataset[int(i)]
        if time.perf_counter() - begun > seconds:
            break
    return n / (time.perf_counter() - begun), n / (time.process_time() - cpu)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=368)
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=10, help="maximum time of one case")
    parser.add_argument("--cache-mb", type=float, default=512)
    parser.add_argument("--keep", help="folder of the recording, which is used again if it exists")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(args.keep or folder)
        if not list(root.glob("house_*/*.h5")):
            mjs.record(
                "pick", out=root, episodes=args.episodes, width=args.width, height=args.height, keep_failures=True, num_worlds=2
            )
        dataset = mjs.Dataset(root)
        print(
            f"{len(dataset.episodes)} episodes, {len(dataset)} observations, decoder: {'PyAV' if video.have_av() else 'ffmpeg'}"
        )
        orders = {"sequential": np.arange(len(dataset)), "random": np.random.default_rng(0).permutation(len(dataset))}
        for name, streams in (("rows", ROWS), ("rows and images", [*ROWS, "obs/sensor_data/*"])):
            for order, indices in orders.items():
                wall, cpu = samples_per_second(root, streams, indices, args.seconds, args.cache_mb)
                print(f"{name:16} {order:11} {wall:9.1f} samples/s, {cpu:9.1f} per second of CPU time")


if __name__ == "__main__":
    main()
