# SPDX-License-Identifier: Apache-2.0
"""Time of an image by its number of pixels, by the number of worlds, and on two threads. All images are rgb with shadows; poses
change before every image.

Worlds: CPU time of an 84 x 84 image on one thread in 1, 16 and 256 worlds; at a ratio of 1, additional worlds cost only their
rays. Pixels: CPU time per pixel in images of three sizes. Threads: wall time of the same images on one and on two threads, which
needs an otherwise idle machine. Many small images are distributed over the threads by world, a few large ones by parts of the
image.
"""

from __future__ import annotations

import statistics
import sys

import camera_scenes
from camera_rate import CPUS, RUNS, Ours, Shot, of_scene
from fetch import Unavailable
from harness import Row, report

SMALL, MIDDLE, LARGE = (84, 84), (224, 224), (640, 480)


def by_worlds(name: str) -> list[Row]:
    rows: list[Row] = []
    for worlds in (1, 16, 256):
        case = Ours(of_scene(name), [Shot(SMALL)], worlds, threads=1)
        case.frame()
        # 256 images per measurement, because a single image takes too little time to measure.
        seconds = [sum(case.frame()[0] for _ in range(256 // worlds)) for _ in range(RUNS)]
        rows.append(
            lower(f"{name}: an image of 84x84, worlds: {worlds}", 1e6 * statistics.median(seconds) / 256, "us", rows, "1 world")
        )
    return rows


def by_pixels(name: str) -> list[Row]:
    rows: list[Row] = []
    for width, height in (SMALL, MIDDLE, LARGE):
        case = Ours(of_scene(name), [Shot((width, height))], 16, threads=1)
        case.frame()
        seconds = [case.frame()[0] for _ in range(RUNS)]
        cost = 1e9 * statistics.median(seconds) / 16 / (width * height)
        rows.append(lower(f"{name}: a pixel of {width}x{height}", cost, "ns", rows, "84x84"))
    return rows


def lower(case: str, cost: float, unit: str, before: list[Row], first: str) -> Row:
    """A row that is compared with the first row of `before`, whose column is named `first`."""
    return Row(case, cost, unit, before[0].ours if before else None, first if before else "", higher_is_better=False)


def by_threads(name: str) -> list[Row]:
    rows = []
    for size, worlds in ((SMALL, 64), (MIDDLE, 8), (LARGE, 1)):
        cases = [Ours(of_scene(name), [Shot(size)], worlds, threads) for threads in (1, 2)]
        one, two = median_seconds(*cases, runs=2 * RUNS + 1)
        text = f"{name}: {worlds} of {size[0]}x{size[1]}, two threads"
        rows.append(Row(text, 1000 * two, "ms", 1000 * one, "one thread", higher_is_better=False, goal=1.9))
    return rows


def median_seconds(*cases: Ours, runs: int) -> list[float]:
    """Median wall seconds of a frame of each case. The cases take turns, so that changes in the machine's speed affect all
    alike."""
    for case in cases:
        case.frame()
    times = [[case.frame()[1] for case in cases] for _ in range(runs)]
    return [statistics.median(seconds) for seconds in zip(*times)]


def main() -> None:
    rows = []
    for name in camera_scenes.CAMERAS:
        rows += by_worlds(name) + by_pixels(name)
        if CPUS > 1:
            rows += by_threads(name)
    report("Cameras: what an image costs", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"cameras_scaling: {error}")
