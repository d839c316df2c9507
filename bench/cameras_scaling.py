"""What an image costs by its pixels, by the number of worlds, and on two threads. All rgb with shadows, poses changed before every image.

Worlds: CPU time of an 84 x 84 image on one thread in 1, 16 and 256 worlds; a ratio of 1 says that worlds cost nothing beyond their rays.
Pixels: CPU time of a pixel in images of three sizes. Threads: wall time of the same images on one thread and on two, which needs a
machine that does nothing else; many small images are spread by worlds, a few large ones by their parts.
"""

from __future__ import annotations

import statistics
import sys

import camera_scenes
from camera_rate import CPUS, RUNS, Ours
from fetch import Unavailable
from harness import Row, report

SMALL, MIDDLE, LARGE = (84, 84), (224, 224), (640, 480)


def cpu_and_wall(*cases: Ours, runs: int = RUNS) -> list[tuple[float, float]]:
    """Median seconds of each; they take turns, so that a machine that drifts drifts for all."""
    for case in cases:
        case.frame()
    times = [[case.frame() for case in cases] for _ in range(runs)]
    return [tuple(map(statistics.median, zip(*case))) for case in zip(*times)]


def by_worlds(name: str) -> list[Row]:
    rows = []
    for worlds in (1, 16, 256):
        # As many images in each measurement, for one image alone is too short to time.
        frames = 256 // worlds
        case = Ours(name, SMALL, ("rgb",), worlds, threads=1)
        case.frame()
        seconds = [sum(case.frame()[0] for _ in range(frames)) for _ in range(RUNS)]
        cost = 1e6 * statistics.median(seconds) / 256
        alone = rows[0].ours if rows else None
        rows.append(Row(f"{name}: an image of 84x84, {worlds} world{'s' * (worlds > 1)}", cost, "us", alone, "1 world" if rows else "", higher_is_better=False,
                        goal=1 if rows else None))
    return rows


def by_pixels(name: str) -> list[Row]:
    rows = []
    for width, height in (SMALL, MIDDLE, LARGE):
        [(cpu, _)] = cpu_and_wall(Ours(name, (width, height), ("rgb",), 16, threads=1))
        cost = 1e9 * cpu / 16 / (width * height)
        small = rows[0].ours if rows else None
        rows.append(Row(f"{name}: a pixel of {width}x{height}", cost, "ns", small, "84x84" if rows else "", higher_is_better=False))
    return rows


def by_threads(name: str) -> list[Row]:
    rows = []
    for size, worlds in ((SMALL, 64), (MIDDLE, 8), (LARGE, 1)):
        (_, one), (_, two) = cpu_and_wall(*(Ours(name, size, ("rgb",), worlds, threads) for threads in (1, 2)), runs=2 * RUNS + 1)
        text = f"{name}: {worlds} {'image' if worlds == 1 else 'images'} of {size[0]}x{size[1]}, two threads"
        rows.append(Row(text, 1000 * two, "ms", 1000 * one, "one thread", higher_is_better=False, goal=1.9))
    return rows


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
