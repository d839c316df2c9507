# SPDX-License-Identifier: Apache-2.0
"""Rendering of recorded episodes: images per second, compared with the recording.

    python bench/render.py [--task pick] [--episodes 8] [--worlds 4]

CPU time includes the encoders; it depends less than elapsed time on other work of the machine.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mjsense as mjs

TOP = {"top": {"pos": (0.5, 0, 1.6), "lookat": (0.5, 0, 0)}}


def cpu_seconds() -> float:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage)


def measure(name: str, images: Callable[[], int]) -> int:
    cpu, begun = cpu_seconds(), time.perf_counter()
    count = images()
    wall, cpu = time.perf_counter() - begun, cpu_seconds() - cpu
    print(f"{name:44} {count:7} images, {count / wall:6.0f} per second, {count / cpu:6.0f} per second of CPU time", flush=True)
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="pick")
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--worlds", type=int, default=4)
    arguments = parser.parse_args()
    worlds = arguments.worlds
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        recorded = measure(
            "recording", lambda: mjs.record(arguments.task, out=root / "a", num_worlds=worlds, episodes=arguments.episodes).frames
        )
        measure(
            "only a new camera", lambda: mjs.render(root / "a", root / "b", cameras=[], add_cameras=TOP, num_worlds=worlds).frames
        )
        measure(
            "a new camera, the others copied",
            lambda: recorded + mjs.render(root / "a", root / "c", add_cameras=TOP, num_worlds=worlds).frames,
        )
        measure("the recorded cameras again", lambda: mjs.render(root / "a", root / "d", copy=False, num_worlds=worlds).frames)


if __name__ == "__main__":
    main()
