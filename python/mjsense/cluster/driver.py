# SPDX-License-Identifier: Apache-2.0
"""The driver of a recording on Ray: hands out shards until the wanted episodes are recorded, and writes the index."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from mjsense.cluster.index import write_index
from mjsense.cluster.job import Job, Shard, ShardResult, run_shard
from mjsense.cluster.storage import Storage
from mjsense.cluster.tasks import check_pickle, cluster, running
from mjsense.dataset import bounded_json
from mjsense.dataset.limits import DESCRIPTION_BYTES


@dataclass(frozen=True)
class ClusterProgress:
    """Progress of a recording on Ray. Attempts are counted when their shard is done."""

    kept: int
    """Episodes in the shards without a gap from the first one."""
    wanted: int
    succeeded: int
    failed: int
    shards: int
    """Shards that are done."""
    workers: int
    """Shards that are being recorded."""
    steps_per_second: float
    """Steps of the policy by all workers, since the driver started."""
    seconds: float
    """Wall-clock time of the driver."""


@dataclass(frozen=True)
class ClusterSummary(ClusterProgress):
    """Result of a recording on Ray."""

    enough: bool
    """Whether all wanted episodes are recorded."""
    failures: dict[str, int]
    """Number of failed attempts by reason."""
    out: str
    """The output directory, which contains ``index.parquet``."""


class _Results:
    """Shards that are done. Totals are kept up to date, because a job may have 100,000 shards."""

    def __init__(self, results: Iterable[ShardResult] = ()) -> None:
        self.done: dict[int, ShardResult] = {}
        self.kept = 0
        """Episodes of the shards without a gap from the first one."""
        self.succeeded = self.failed = self.steps = 0
        self._next = 0
        for result in results:
            self.add(result)
        self._old_steps = self.steps

    @staticmethod
    def read(storage: Storage, fingerprint: str) -> _Results:
        """The shards in a directory that belong to a job with this fingerprint."""
        texts = storage.read_all("shard_*/done.json")
        results = (ShardResult.parse(text) for text in texts)
        return _Results(result for result in results if result.fingerprint == fingerprint)

    def add(self, result: ShardResult) -> None:
        self.done[result.shard.number] = result
        self.succeeded += result.succeeded
        self.failed += result.failed
        self.steps += result.steps
        while self._next in self.done:
            self.kept += len(self.done[self._next].episodes)
            self._next += 1

    def without_gap(self) -> list[ShardResult]:
        return [self.done[number] for number in range(self._next)]

    def progress(self, wanted: int, workers: int, seconds: float) -> dict[str, Any]:
        return {
            "kept": self.kept,
            "wanted": wanted,
            "succeeded": self.succeeded,
            "failed": self.failed,
            "shards": len(self.done),
            "workers": workers,
            "steps_per_second": (self.steps - self._old_steps) / seconds if seconds > 0 else 0.0,
            "seconds": seconds,
        }


def _claim(storage: Storage, job: Any, more: dict[str, Any], resume: bool) -> None:
    """Writes what the directory contains, or compares it with what it contains already."""
    ours = {**job.settings(), **more}
    found = storage.read("job.json")
    if found is None:
        return storage.write("job.json", json.dumps(ours, indent=1, sort_keys=True).encode())
    theirs = bounded_json.parse_object(found, f"{job.out}/job.json", DESCRIPTION_BYTES)
    if not resume:
        raise FileExistsError(f"{job.out} contains a recording: continue it with resume (--resume), or choose another directory")
    for name in sorted({*ours, *theirs}):
        if ours.get(name) != theirs.get(name):
            raise ValueError(
                f"{job.out} contains a different recording: {name} is {theirs.get(name)!r} there, and {ours.get(name)!r} here"
            )


def record_on_ray(
    job: Job,
    *,
    episodes: int,
    max_attempts: int = 0,
    shard_attempts: int = 16,
    address: str = "local",
    resume: bool = False,
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[ClusterProgress], None] | None = None,
) -> ClusterSummary:
    """Records episodes as stateless Ray tasks of one CPU each. The episodes are those of one process with the same arguments.

    A task that is lost with its worker is repeated; an exception of the recording ends it here. The driver may be killed at any
    time and continues with ``resume``.

    Args:
        job: What to record, and where.
        episodes: Number of episodes to keep: the first ones.
        max_attempts: Maximum number of attempts; 0: six times ``episodes``.
        shard_attempts: Attempts of one task.
        address: ``local`` for a cluster of this machine's CPUs that ends with the recording, ``auto``, or the address of a
            cluster.
        resume: Continue an interrupted recording.
        runtime_env: Ray's runtime environment: ``working_dir``, ``pip`` and so on.
        progress: Called about once per second.

    Returns:
        Counts, reasons of failures, and whether all wanted episodes are recorded.

    Raises:
        FileExistsError: ``job.out`` contains a recording, and ``resume`` is False.
        ValueError: ``job.out`` contains a recording with other settings.
        TypeError: An argument of the job cannot be sent to the workers.
        ModuleNotFoundError: Ray, fsspec or pyarrow is not installed.
    """
    if episodes < 1 or shard_attempts < 1:
        raise ValueError(f"episodes is {episodes} and shard_attempts is {shard_attempts}: both must be at least 1")
    if (job.arguments or {}).get("format", "mjsense") != "mjsense":
        raise ValueError("record: format cannot be combined with a recording on Ray; export its index afterwards")
    check_pickle("record", job.arguments)
    attempts = max_attempts or 6 * episodes
    shards = [
        Shard(n, n * shard_attempts, min(shard_attempts, attempts - n * shard_attempts))
        for n in range(math.ceil(attempts / shard_attempts))
    ]
    return run_job(job, shards, episodes, {"shard_attempts": shard_attempts}, address, resume, runtime_env, progress)


def run_job(
    job: Any,
    shards: list[Shard],
    episodes: int,
    more: dict[str, Any],
    address: str,
    resume: bool,
    runtime_env: dict[str, Any] | None,
    progress: Callable[[ClusterProgress], None] | None,
) -> ClusterSummary:
    """Runs the shards of a job until ``episodes`` are there without a gap, and writes the index.

    Args:
        job: A :class:`Job`, or an object with its attributes ``out``, ``settings``, ``fingerprint``, ``about`` and ``record``.
        more: Settings of the division into shards.
    """
    storage, fingerprint = Storage(job.out), job.fingerprint()
    _claim(storage, job, more, resume)
    results = _Results.read(storage, fingerprint)
    began = time.perf_counter()
    workers = 0

    def report() -> dict[str, Any]:
        now = results.progress(episodes, workers, time.perf_counter() - began)
        if progress is not None:
            progress(ClusterProgress(**now))
        return now

    with cluster(address, runtime_env) as ray:
        began = time.perf_counter()
        waiting = ((job, shard, fingerprint) for shard in shards if shard.number not in results.done)
        with running(ray, run_shard, waiting, lambda job, shard, _: f"Shard {shard.number} ({job.about(shard)})") as tasks:
            while report()["kept"] < episodes:
                done = tasks.wait()
                workers = tasks.count
                for _, result in done:
                    results.add(result)
                if not done and not workers:
                    break
        workers = 0
        final = report()
    write_index(storage, results.without_gap(), episodes)
    failures: Counter[str] = Counter()
    for result in results.done.values():
        failures.update(result.failures)
    return ClusterSummary(**final, enough=final["kept"] >= episodes, failures=dict(failures), out=job.out)
