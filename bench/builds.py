# SPDX-License-Identifier: Apache-2.0
"""Compares cameras and rays of this build with those of another build of mjsense. The two builds take turns in one run.

    ./dev bench builds --other=../before/build/release

`--other` is the release build of another checkout, with the program mjsense_bench and the Python package. The views are those of
cameras.py at 640 x 480 on one thread; everything that a view varies is changed before every image. The rays are those of rays.py,
with stand-ins for the robots.
"""

from __future__ import annotations

import json
import os
import pathlib
import statistics
import subprocess
import sys

from camera_scenes import VIEWS
from harness import ROOT, Row, report

SIZE = (640, 480)
KINDS = {"rgb with shadows": (("rgb",), True), "rgb without shadows": (("rgb",), False), "depth": (("depth",), False)}
RAYS = ("height_scan/height_field/1", "height_scan/boxes/1", "height_scan/boxes/2", "lidar/1", "lidar/2")
ROUNDS = 5


def of_view(name: str) -> dict[str, float]:
    """CPU milliseconds per image of each kind, measured with the build that this process uses."""
    from camera_rate import Ours, Shot

    ours = Ours(VIEWS[name], [Shot(SIZE, *kind) for kind in KINDS.values()], worlds=2, threads=1)
    return {kind: 1e3 / ours.rate(i) for i, kind in enumerate(KINDS)}


def measured(build: pathlib.Path, view: str) -> dict[str, float]:
    child = [sys.executable, __file__, "--child", view]
    environment = {**os.environ, "MJSENSE_BENCH_BUILD": str(build)}
    return json.loads(subprocess.run(child, check=True, stdout=subprocess.PIPE, text=True, env=environment).stdout)


def rays(build: pathlib.Path) -> dict[str, float]:
    """Microseconds per iteration of each benchmark."""
    names = "|".join(f"^{name}(/real_time)?$" for name in RAYS)
    command = [build / "mjsense_bench", f"--benchmark_filter={names}", "--benchmark_format=json", "--benchmark_min_time=0.1"]
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    return {
        r["run_name"].removesuffix("/real_time"): 1e-3 * r["real_time"] for r in json.loads(text[text.index("{") :])["benchmarks"]
    }


def medians(builds: list[pathlib.Path], measure) -> list[dict[str, float]]:
    """For each build, the median of every measurement by its name. The builds take turns."""
    rounds = [[measure(build) for build in builds] for _ in range(ROUNDS)]
    return [{key: statistics.median(r[i][key] for r in rounds) for key in rounds[0][i]} for i in range(len(builds))]


def main() -> None:
    other = [a.removeprefix("--other=") for a in sys.argv if a.startswith("--other=")]
    if not other:
        sys.exit("builds: pass --other=DIR, the folder build/release of another checkout")
    builds = [ROOT / "build/release", pathlib.Path(other[0]).resolve()]
    rows = []
    for name, view in VIEWS.items():
        now, before = medians(builds, lambda build, name=name: measured(build, name))
        rows += [Row(f"{view.label}, {kind}", now[kind], "ms", before[kind], "before", higher_is_better=False) for kind in KINDS]
        print(rows[-3:], file=sys.stderr)
    now, before = medians(builds, rays)
    for name in RAYS:
        rows.append(Row(name, now[name], "us", before[name], "before", higher_is_better=False))
    report("Two builds", rows)


if __name__ == "__main__":
    if "--child" in sys.argv:
        print(json.dumps(of_view(sys.argv[-1])))
    else:
        main()
