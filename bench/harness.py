"""What every benchmark here shares: the built program and Python package, two things timed in turn in one run, medians, and one table.

A script `bench/<name>.py` measures and calls `report(rows)`. Run it alone after `./dev bench` built what it needs, or all of them with
`./dev bench`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pathlib
import statistics
import sys
import time
from collections.abc import Callable

ROOT = pathlib.Path(__file__).resolve().parents[1]
RELEASE = ROOT / "build" / "release"  # what ./dev bench builds
if not (RELEASE / "python").exists():
    sys.exit(f"{RELEASE} is missing: ./dev bench builds it")
sys.path.insert(0, str(RELEASE / "python"))  # so that `import mjsense` after this module finds what is measured


def program(name: str) -> str:
    """The path of a built program."""
    return str(RELEASE / name)


@dataclasses.dataclass
class Row:
    """One comparison. `ratio` is how many times faster (or smaller) ours is than the peer, by medians."""

    case: str  # what is measured, with the scene's size
    ours: float
    unit: str  # of ours and peer
    peer: float | None = None  # None: nothing to compare with
    peer_name: str = ""
    higher_is_better: bool = True
    goal: float | None = None  # wanted ratio

    @property
    def ratio(self) -> float | None:
        if self.peer is None:
            return None
        return self.ours / self.peer if self.higher_is_better else self.peer / self.ours


def median_seconds(*bodies: Callable[[], object], runs: int = 5, warmup: int = 1) -> list[float]:
    """Median wall seconds of each body; the bodies take turns, so that a machine that drifts drifts for all."""
    times: list[list[float]] = [[] for _ in bodies]
    for run in range(warmup + runs):
        for body, seconds in zip(bodies, times):
            start = time.perf_counter()
            body()
            if run >= warmup:
                seconds.append(time.perf_counter() - start)
    return [statistics.median(s) for s in times]


def machine() -> str:
    model = "unknown CPU"
    try:
        with open("/proc/cpuinfo") as f:
            model = next((line.split(":", 1)[1].strip() for line in f if line.startswith("model name")), model)
    except OSError:
        pass
    return f"{model}, {len(os.sched_getaffinity(0))} CPUs"


def _number(x: float | None) -> str:
    if x is None:
        return ""
    return f"{x:,.0f}" if abs(x) >= 1000 else f"{x:.3g}"


def report(title: str, rows: list[Row]) -> None:
    """Print the table, or with --json one object a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    args, _ = parser.parse_known_args()
    if args.json:
        for row in rows:
            print(json.dumps({"title": title, "machine": machine(), **dataclasses.asdict(row), "ratio": row.ratio}))
        return
    print(f"\n## {title}\n\n{machine()}\n")
    print("| case | ours | peer | unit | ratio | goal |\n| --- | ---: | ---: | --- | ---: | ---: |")
    for row in rows:
        ratio = f"{row.ratio:.2f} x" if row.ratio is not None else ""
        peer = f"{_number(row.peer)} ({row.peer_name})" if row.peer is not None else ""
        goal = f"{row.goal:g} x" if row.goal is not None else ""
        print(f"| {row.case} | {_number(row.ours)} | {peer} | {row.unit} | {ratio} | {goal} |")
