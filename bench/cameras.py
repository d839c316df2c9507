"""Images a second of CPU time: ours beside MuJoCo's classic renderer (EGL, llvmpipe), poses changed before every image.

The classic renderer runs in one process a CPU at a time, without multisampling (its fastest setting); we in one process with as
many threads. CPU time of all threads is counted, so that other work on the machine does not decide. Rendering alone is timed:
physics and mj_forward are not, updating our ray scene and MuJoCo's mjvScene are. Names of scenes as arguments measure these alone.
"""

from __future__ import annotations

import os
import statistics
import sys
from concurrent.futures import ThreadPoolExecutor

import camera_scenes
from camera_rate import CPUS, measure
from fetch import Unavailable, run_peer, wheel
from harness import Row, report

SIZES = ((84, 84), (224, 224), (640, 480))
GOALS = {  # rgb with shadows, depth
    "panda": ((90, 20, 6), (35, 10, 4)),
    "kitchen": ((180, 45, 12), (18, 6, 3)),
    "go1": ((110, 30, 7), (20, 7, 3)),
}


def classic(name: str, size: tuple[int, int], kind: str) -> float:
    """Images a CPU second of as many processes as there are CPUs."""
    os.environ.setdefault("LP_NUM_THREADS", "1")  # one process a CPU: llvmpipe's own threads would only be in the way
    with ThreadPoolExecutor() as pool:
        runs = [pool.submit(run_peer, None, "classic_cameras", name, *map(str, size), kind) for _ in range(CPUS)]
    return statistics.harmonic_mean([run.result()["images_per_second"] for run in runs])


def main() -> None:
    wheel("PyOpenGL")  # before the processes of the classic renderer want it at the same time
    names = [n for n in GOALS if n in sys.argv] or list(GOALS)
    rows = []
    for name in names:
        print(f"{name}: {camera_scenes.describe(camera_scenes.compiled(name))}", file=sys.stderr)
        for index, size in enumerate(SIZES):
            for goals, kind in zip(GOALS[name], ("rgb", "depth")):
                case = f"{name} {size[0]}x{size[1]} {kind}{' with shadows' if kind == 'rgb' else ''}"
                peer = classic(name, size, kind)
                ours = measure(name, size, (kind,), 8 * CPUS).rate
                rows.append(Row(case, ours, "images/CPU s", peer, "classic", goal=goals[index]))
                print(f"{case}: {ours:.0f} against {peer:.1f}", file=sys.stderr)
    report("Cameras", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"cameras: {error}")
