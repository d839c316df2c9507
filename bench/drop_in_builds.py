# SPDX-License-Identifier: Apache-2.0
"""CPU time of images of existing environments with two builds of mjsense, and whether the images are equal.

    python bench/drop_in_builds.py BEFORE AFTER [--size 256] [--rounds 100] [ENVIRONMENT ...]

BEFORE and AFTER are folders that contain the Python package mjsense of a build, such as copies of build/dev/python (`cp -rL`).
Each build has a process of its own. They draw the same states in turns of four images; the ratio is the median of the turns'
ratios.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import statistics
import subprocess
import sys
import time

TURN = 4


def draw(name: str, size: str) -> None:
    """Draws a turn for each line of the standard input, and prints its CPU time in ms; at the end the digest of all images."""
    import drop_in

    drop_in.prepare()
    _, step, render = drop_in.make(name, drop_in.size_of(size), True)
    images = hashlib.sha256(render().tobytes())
    print("ready", flush=True)
    for _ in sys.stdin:
        spent = 0.0
        for _ in range(TURN):
            step()
            start = time.process_time()
            image = render()
            spent += time.process_time() - start
            images.update(image.tobytes())
        print(1e3 * spent / TURN, flush=True)
    print(images.hexdigest())


def line_of(build: subprocess.Popen[str]) -> str:
    assert build.stdout
    return build.stdout.readline()


def compare(name: str, size: str, rounds: int, folders: list[str]) -> None:
    command = [sys.executable, "-W", "ignore", __file__, "--draw", name, "--size", size, "", ""]
    builds = [
        subprocess.Popen(
            command, env={**os.environ, "PYTHONPATH": folder}, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for folder in folders
    ]
    for build in builds:
        while (line := line_of(build)) != "ready\n":  # packages may print before it
            if not line:
                sys.exit(f"{name}: a build has ended, see above")
    turns = []
    for _ in range(rounds):
        turns.append([])
        for build in builds:
            print(file=build.stdin, flush=True)
            turns[-1].append(float(line_of(build)))
    before, after = (statistics.median(times) for times in zip(*turns))
    digests = [build.communicate()[0] for build in builds]
    ratio = statistics.median(b / a for a, b in turns)
    equal = "equal" if digests[0] == digests[1] else "different"
    print(f"{name:38s} {size:>8s} {before:8.3f} {after:8.3f} ms, ratio {ratio:.3f}, images are {equal}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs=2, metavar=("BEFORE", "AFTER"))
    parser.add_argument("environments", nargs="*", default=["HandManipulateBlock-v1", "FetchPickAndPlace-v4"])
    parser.add_argument("--size", default="256")
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--draw", help=argparse.SUPPRESS)
    arguments = parser.parse_intermixed_args()  # environments may follow options
    if arguments.draw:
        return draw(arguments.draw, arguments.size)
    for name in arguments.environments:
        compare(name, arguments.size, arguments.rounds, arguments.folders)


if __name__ == "__main__":
    main()
