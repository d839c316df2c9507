# SPDX-License-Identifier: Apache-2.0
"""What an image costs by its pixels, by the number of worlds, and on two threads. All rgb with shadows, poses changed before every image.

Worlds: CPU time of an 84 x 84 image on one thread in 1, 16 and 256 worlds; a ratio of 1 says that worlds cost nothing beyond their rays.
Pixels: CPU time of a pixel in images of three sizes. Threads: wall time of the same images on one thread and on two, which needs a
machine that does nothing else; many small images are spread by worlds, a few large ones by their parts.
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
        # 256 images in each measurement, for one alone is short.
        seconds = [sum(case.frame()[0] for _ in range(256 // worlds)) for _ in range(RUNS)]
        rows.append(lower(f"{name}: an image of 84x84, worlds: {worlds}", 1e6 * statistics.median(seconds) / 256, "us", rows, "1 world"))
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
    """Beside the first of the rows before it; called `first`."""
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
    """Median wall seconds of a frame of each; they take turns, so that a machine that drifts drifts for all."""
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
