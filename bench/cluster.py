# SPDX-License-Identifier: Apache-2.0
"""Recording on Ray: scaling, overhead of a shard, memory of a worker, index of many shards, and a study of large clusters.

    ./dev python bench/cluster.py                     all but the study; needs ray, fsspec and pyarrow
    ./dev python bench/cluster.py --scaling 1 2       wall time with these numbers of workers, each with as many CPUs
    ./dev python bench/cluster.py --overhead          cost of a shard: 8 attempts as one shard and as eight
    ./dev python bench/cluster.py --memory            of a worker
    ./dev python bench/cluster.py --index 1000 100000 write and read of an index of so many shards
    ./dev python bench/cluster.py --study             1,000,000 episodes on 1,000 workers, simulated
                                                      with the figures measured here

A worker of the scaling test has one CPU for the simulation and its encoders. Without this limit a single worker would use the
second CPU for its encoders, and the comparison would be one of 1.3 with 2 CPUs.
"""

import argparse
import heapq
import os
import random
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from mjsense.cluster import Job, record_on_ray
from mjsense.cluster.driver import _Results
from mjsense.cluster.index import write_index
from mjsense.cluster.job import Shard, ShardResult, run_shard
from mjsense.cluster.storage import Storage
from mjsense.dataset.files import read_index

ARGUMENTS = {"task": "pick", "horizon": 80, "keep_failures": True, "width": 320, "height": 184, "num_worlds": 2, "seed": 2}


def cpu() -> float:
    """CPU seconds of this process and its ended children."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def scaling(counts: list[int]) -> None:
    import ray

    every, first = os.sched_getaffinity(0), None
    for workers in counts:
        os.sched_setaffinity(0, sorted(every)[:workers])
        ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
        warm = ray.remote(num_cpus=1)(lambda: time.sleep(1))
        ray.get([warm.remote() for _ in range(workers)])
        with tempfile.TemporaryDirectory() as out:
            summary = record_on_ray(Job(out, ARGUMENTS), episodes=32, max_attempts=32, shard_attempts=4)
        peak = max(ray.get([ray.remote(num_cpus=1)(_peak).remote() for _ in range(workers)]))
        ray.shutdown()
        os.sched_setaffinity(0, every)
        first = first or summary.seconds * workers
        print(
            f"{workers} workers on {workers} CPUs: {summary.seconds:.1f} s for {summary.kept} episodes, "
            f"{first / summary.seconds:.2f} x one worker, "
            f"{peak:.0f} MB per worker"
        )


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def overhead() -> None:
    """Prints what a division into one more shard costs in a warm worker."""
    words = ("pick", "--horizon", "80", "--keep-failures", "--size", "320x184", "--worlds", "1", "--seed", "2")
    jobs: list[tuple[str, dict[str, Any]]] = [
        ("mjs.record", {"arguments": {**ARGUMENTS, "num_worlds": 1}}),
        ("command", {"words": words}),
    ]
    for name, made in jobs:
        with tempfile.TemporaryDirectory() as out:
            job = Job(out, **made)
            run_shard(job, Shard(99, 99, 1), "")  # imports and files
            times = []
            for shards in (1, 8):
                begun, used = time.perf_counter(), cpu()
                for n in range(shards):
                    run_shard(job, Shard(100 * shards + n, 8 // shards * n, 8 // shards), "")
                times.append((time.perf_counter() - begun, cpu() - used))
        (wall, used), (wall_8, used_8) = times
        print(f"overhead of a shard ({name}): {(wall_8 - wall) / 7:.2f} s, {(used_8 - used) / 7:.2f} s of CPU time")


def memory() -> None:
    for worlds in (2, 4):
        with tempfile.TemporaryDirectory() as out:
            run_shard(
                Job(out, {**ARGUMENTS, "horizon": 20, "width": 640, "height": 368, "num_worlds": worlds}), Shard(0, 0, 4), ""
            )
        print(f"memory of a worker with {worlds} worlds, two cameras of 640x368, without Ray and encoders: {_peak():.0f} MB")


def _result(number: int, episodes: int) -> ShardResult:
    row = {
        "path": "house_0/trajectories_batch_1_of_4.h5",
        "seed": 2,
        "length": 81,
        "success": True,
        "outcome": "success",
        "task": "Raise the red brick",
    }
    first = number * 16
    return ShardResult(
        Shard(number, first, 16),
        "0" * 16,
        [{**row, "episode": first + i, "trajectory": f"traj_{i}"} for i in range(episodes)],
        16,
        0,
        1280,
    )


def index(shards: int, episodes: int) -> None:
    with tempfile.TemporaryDirectory() as out:
        storage, results = Storage(out), [_result(n, episodes) for n in range(shards)]
        begun = time.perf_counter()
        totals = _Results(results)
        added = time.perf_counter() - begun
        begun = time.perf_counter()
        rows = write_index(storage, totals.without_gap(), shards * episodes)
        wrote = time.perf_counter() - begun
        begun = time.perf_counter()
        assert len(read_index(Path(out))) == rows
        print(
            f"index of {shards} shards with {episodes} episodes: "
            f"{(Path(out) / 'index.parquet').stat().st_size / 1e6:.3f} MB, written in {wrote:.2f} s, "
            f"read in {time.perf_counter() - begun:.2f} s; driver's totals {added / shards * 1e6:.1f} us per shard"
        )


def study(workers: int, episodes: int) -> None:
    """Prints a table for different sizes of shards."""
    attempt_s = 1.5  # pick, 80 steps, two cameras of 640x368: CPU time with encoders
    shard_s = 0.2  # --overhead: 0.15 s, and the copy of the files
    driver_s = 0.002  # of the driver per shard: Ray's start and result of a task 0.7 ms, totals 0.002 ms, and the connection
    death_s = 360_000.0  # a worker dies once in 100 h, and Ray needs 10 s to start its shard again
    episode_mb, videos = 0.85, 2  # docs/formats.md, Sizes: 9.8 kB per observation
    rng = random.Random(0)
    print(
        f"{'attempts per shard':>18} {'shards':>8} {'hours':>6} {'efficiency':>10} {'driver busy':>11} "
        f"{'repeated':>9} {'surplus':>8} {'files, million':>14}"
    )
    for size in (1, 4, 16, 64, 256):
        shards, ended, repeated, driver_free, done = -(-episodes // size), 0.0, 0.0, 0.0, 0
        ready = [(0.0, w) for w in range(workers)]
        heapq.heapify(ready)
        busy = 0.0
        while done < shards:
            now, worker = heapq.heappop(ready)
            start = driver_free = max(now, driver_free) + driver_s  # one shard after the other
            duration = shard_s + size * attempt_s * rng.uniform(0.9, 1.1)
            if rng.random() < duration / death_s:  # dies half-way on average, and Ray starts the shard again
                lost = duration * rng.random()
                repeated += lost
                start += lost + 10.0
            heapq.heappush(ready, (start + duration, worker))
            busy += driver_s
            done += 1
            ended = max(ended, start + duration)
        ideal = episodes * attempt_s / workers
        surplus = workers * size / episodes
        print(
            f"{size:18} {shards:8} {ended / 3600:6.2f} {ideal / ended:10.1%} {busy / ended:11.1%} "
            f"{repeated / 3600:7.2f} h {surplus:8.1%} {(episodes * (videos + 0.25) + 2 * shards) / 1e6:14.1f}"
        )
    print(
        f"storage: {episodes * episode_mb / 1e6:.2f} TB, written at "
        f"{episodes * episode_mb / (episodes * attempt_s / workers) / 1e3:.2f} GB/s"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scaling", type=int, nargs="+", metavar="WORKERS")
    parser.add_argument("--overhead", action="store_true")
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--index", type=int, nargs="+", metavar="SHARDS")
    parser.add_argument("--study", action="store_true")
    given = parser.parse_args()
    everything = len(sys.argv) == 1
    if everything or given.scaling:
        scaling(given.scaling or [1, 2])
    if everything or given.memory:
        memory()
    if everything or given.overhead:
        overhead()
    for shards in given.index or ([1000, 100_000] if everything else []):
        index(shards, 0)
        index(shards, 10)
    if given.study:
        study(1000, 1_000_000)
