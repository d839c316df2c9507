# SPDX-License-Identifier: Apache-2.0
"""Shared by all benchmarks: paths of the built program and Python package, medians of alternating measurements, and the table of
results.

Each script `bench/<name>.py` measures and calls `report(title, rows)`. `./dev bench` builds and runs all of them; afterwards a
script can be run by itself.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

ROOT = pathlib.Path(__file__).resolve().parents[1]
RELEASE = pathlib.Path(os.environ.get("MJSENSE_BENCH_BUILD", ROOT / "build" / "release"))  # the build to measure
RESULTS = ROOT / ".cache" / "bench" / "results"  # results of the last runs, which page.py reads
if not (RELEASE / "python").exists():
    sys.exit(f"{RELEASE} is missing: ./dev bench builds it")
sys.path.insert(0, str(RELEASE / "python"))  # so that a later `import mjsense` finds the measured build
# In other processes too.
os.environ["PYTHONPATH"] = os.pathsep.join([str(RELEASE / "python"), *filter(None, [os.environ.get("PYTHONPATH")])])
MJSENSE = [sys.executable, "-m", "mjsense"]
"""The program."""


def program(name: str) -> str:
    """The path of a built program."""
    return str(RELEASE / name)


def run_program(name: str, *options: str, **environment: str) -> str:
    """Standard output of a built program."""
    return subprocess.run(
        [program(name), *options],
        check=True,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ).stdout


def google_benchmarks(names: str, runs: int = 5, /, **environment: str) -> dict[str, dict]:
    """Runs the benchmarks of mjsense_bench whose names match the pattern, interleaved. Returns by name the medians of real and
    CPU nanoseconds and of the items per iteration, and the counters of the first run."""
    text = run_program(
        "mjsense_bench",
        f"--benchmark_filter={names}",
        "--benchmark_format=json",
        "--benchmark_min_time=0.1",
        f"--benchmark_repetitions={runs}",
        "--benchmark_enable_random_interleaving=true",
        **environment,
    )
    same: dict[str, list[dict]] = {}
    for run in json.loads(text[text.index("{") :])["benchmarks"]:
        if run["run_type"] == "iteration":
            same.setdefault(run["run_name"].removesuffix("/real_time"), []).append(run)
    medians = {}
    for name, all_runs in same.items():
        real, cpu = (statistics.median(r[k] for r in all_runs) for k in ("real_time", "cpu_time"))
        # items_per_second refers to real time in benchmarks with UseRealTime().
        per_second = statistics.median(r.get("items_per_second", 0.0) for r in all_runs)
        counted = real if "/real_time" in all_runs[0]["name"] else cpu
        medians[name] = {**all_runs[0], "real": real, "cpu": cpu, "items": per_second * counted * 1e-9}
    return medians


@dataclasses.dataclass
class Row:
    """One comparison. `ratio` is how many times faster (or smaller) mjsense is than the peer, by medians."""

    case: str  # what is measured, including the size of the scene
    ours: float
    unit: str  # of both `ours` and `peer`
    peer: float | None = None  # None: there is no peer
    peer_name: str = ""
    higher_is_better: bool = True
    goal: float | None = None  # minimum ratio; a lower one is reported

    @property
    def ratio(self) -> float | None:
        if self.peer is None:
            return None
        return self.ours / self.peer if self.higher_is_better else self.peer / self.ours


def median_seconds(*bodies: Callable[[], object], runs: int = 5, warmup: int = 1) -> list[float]:
    """Median wall seconds of each body. The bodies take turns, so that changes in the machine's speed affect all alike."""
    times: list[list[float]] = [[] for _ in bodies]
    for run in range(warmup + runs):
        for body, seconds in zip(bodies, times):
            start = time.perf_counter()
            body()
            if run >= warmup:
                seconds.append(time.perf_counter() - start)
    return [statistics.median(s) for s in times]


def machine() -> str:
    model, vectors = "unknown CPU", "vectors unknown"
    try:
        text = subprocess.run(["lscpu"], capture_output=True, text=True, check=True, env={**os.environ, "LC_ALL": "C"}).stdout
        said = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in text.splitlines())}
        model = said.get("Model name", model)
        flags = said.get("Flags", "").split()
        known = (("avx512f", "AVX-512"), ("avx2", "AVX2"), ("sse2", "SSE2"), ("asimd", "NEON"))
        vectors = next((text for flag, text in known if flag in flags), vectors)
    except (OSError, subprocess.CalledProcessError):
        pass
    return f"{model}, {len(os.sched_getaffinity(0))} CPUs, {vectors}"


LOAD_BEFORE = os.getloadavg()[0]  # benchmarks import this module before they measure


def load() -> str:
    """Load of the machine: one-minute load averages before and after the benchmark."""
    return f"load average {LOAD_BEFORE:.1f} before, {os.getloadavg()[0]:.1f} after"


def number(x: float | None) -> str:
    if x is None:
        return ""
    return f"{x:,.0f}" if abs(x) >= 1000 else f"{x:.3g}"


def table(rows: list[dict]) -> str:
    """A Markdown table with a line per case and a column per peer: the peer's figure, and the ratio (above 1: mjsense is
    better)."""
    peers = list(dict.fromkeys(r["peer_name"] for r in rows if r["peer"] is not None))
    cases: dict[tuple, list[dict]] = {}
    for i, row in enumerate(rows):
        key = (row["case"], row["unit"]) if row["peer"] is not None else (row["case"], row["unit"], i)
        cases.setdefault(key, []).append(row)
    lines = [f"| case | unit | ours |{''.join(f' {p} |' for p in peers)}", f"| --- | --- | ---: |{' ---: |' * len(peers)}"]
    for (case, unit, *_), same in cases.items():
        figures = {r["peer_name"]: f"{number(r['peer'])} ({r['ratio']:.3g} x)" for r in same if r["peer"] is not None}
        lines.append(f"| {case} | {unit} | {number(same[0]['ours'])} |{''.join(f' {figures.get(p, str())} |' for p in peers)}")
    return "\n".join(lines)


def report(title: str, rows: list[Row]) -> None:
    """Prints the table, or with --json one object per line, and stores the rows for page.py."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    args, _ = parser.parse_known_args()
    flat = [{**dataclasses.asdict(row), "ratio": row.ratio} for row in rows]
    RESULTS.mkdir(parents=True, exist_ok=True)
    kept = {"title": title, "machine": machine(), "load": load(), "rows": flat}
    parts = [a for a in sys.argv[1:] if not a.startswith("-")]  # a benchmark may be run in parts, each with its own file
    (RESULTS / f"{'-'.join([pathlib.Path(sys.argv[0]).stem, *parts])}.json").write_text(json.dumps(kept, indent=1))
    if args.json:
        for row in flat:
            print(json.dumps({"title": title, "machine": machine(), "load": load(), **row}))
        return
    print(f"\n## {title}\n\n{machine()}; {load()}\n\n{table(flat)}")
    for row in rows:
        if row.goal is not None and row.ratio is not None and row.ratio < row.goal:
            print(f"below its goal of {row.goal:.3g} x: {row.case}, {row.ratio:.3g} x {row.peer_name}", file=sys.stderr)
