# SPDX-License-Identifier: Apache-2.0
"""Rendering and export of recordings on Ray."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mjsense import _core
from mjsense.cluster.driver import ClusterProgress, ClusterSummary, run_job
from mjsense.cluster.job import Shard
from mjsense.cluster.storage import Storage
from mjsense.cluster.tasks import check_pickle, cluster, running
from mjsense.dataset import Dataset, render
from mjsense.dataset.remote import is_address, resolved
from mjsense.export import export_lerobot, export_lerobot21, export_mcap, export_rerun
from mjsense.export.frame_statistics import frame_histograms
from mjsense.export.mapping import Mapping, Source

_CHUNK = 16  # episodes of one task


@dataclass(frozen=True)
class _Rendering:
    """A rendering as a job: its shards are ranges of the chosen episodes."""

    root: str
    out: str
    positions: tuple[int, ...]
    arguments: dict[str, Any] = field(default_factory=dict)

    def settings(self) -> dict[str, Any]:
        values = {"version": _core.__version__, "root": self.root, "episodes": self.positions, "options": self.arguments}  # pyright: ignore[reportAttributeAccessIssue]
        return json.loads(json.dumps(values, default=_text))

    def fingerprint(self) -> str:
        return hashlib.sha256(json.dumps(self.settings(), sort_keys=True).encode()).hexdigest()[:16]

    def record(self, folder: Path, shard: Shard) -> dict[str, Any]:
        chosen = self.positions[shard.first : shard.first + shard.count]
        render(self.root, folder, episodes=chosen, **{"threads": 1, **self.arguments, "progress": False})
        episodes = Dataset(folder).episodes
        succeeded = sum(episode.success for episode in episodes)
        return {"succeeded": succeeded, "failed": len(episodes) - succeeded, "steps": sum(e.length for e in episodes), "failures": {}}


def _text(value: Any) -> str:
    """What decides an argument, without addresses of objects."""
    if isinstance(value, partial):
        return f"{_text(value.func)}{value.args}"
    return getattr(value, "__qualname__", None) or str(value)


def _absolute(root: str | Path) -> str:
    return str(root) if is_address(root) else str(Path(root).resolve())


def render_on_ray(
    root: str | Path,
    out: str | Path,
    *,
    episodes: Sequence[int] | None = None,
    shard_episodes: int = _CHUNK,
    address: str = "local",
    resume: bool = False,
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[ClusterProgress], None] | None = None,
    **options: Any,
) -> ClusterSummary:
    """Renders recorded episodes as :func:`mjsense.render` does, on Ray. The result has shards and an index, as a recording on Ray.

    Args:
        root: A recording that all workers see: a path, an index, or an address.
        out: Output directory, or an address.
        episodes: Positions of episodes in the recording; by default all.
        shard_episodes: Number of episodes of one task.
        address: ``local`` for a cluster of this machine's CPUs, ``auto``, or the address of a cluster.
        resume: Continue an interrupted rendering with the same arguments.
        runtime_env: Ray's runtime environment.
        progress: Called about once per second.
        options: Further arguments of :func:`mjsense.render`. Sensors must be a function that makes them.
    """
    if wrong := [name for name in options if name in ("batches", "resume", "progress")]:
        raise ValueError(f"render_on_ray: '{wrong[0]}' is not an option of a rendering on Ray")
    check_pickle("render", options)
    count = len(Dataset(root).episodes)
    positions = tuple(range(count)) if episodes is None else tuple(episodes)
    if invalid := [i for i in positions if not 0 <= i < count]:
        raise ValueError(f"episodes: {invalid[0]} is not in {root}, which has {count} episodes")
    job = _Rendering(_absolute(root), _absolute(out), positions, options)
    shards = [Shard(n, first, min(shard_episodes, len(positions) - first)) for n, first in enumerate(range(0, len(positions), shard_episodes))]
    return run_job(job, shards, len(positions), {"shard_episodes": shard_episodes}, address, resume, runtime_env, progress)


def _histograms_of(root: str, videos: list[tuple[str, int]], frames: int | Literal["key"]) -> list[tuple[np.ndarray, int]]:
    """Histograms of videos, given by their paths relative to the recording and their numbers of frames."""
    local, remote = resolved(root)
    found = []
    for name, length in videos:
        if remote is not None:
            remote.fetch((local / name).parent)
        found.append(frame_histograms(local / name, length, frames))
    return found


def _export_files(format: str, root: str, out: str, episodes: list[int], options: dict[str, Any]) -> None:
    """Writes the files of some episodes."""
    with tempfile.TemporaryDirectory(prefix="mjsense_export_") as folder:
        function = {"mcap": export_mcap, "rerun": export_rerun}[format]
        Storage(out).put_folder(function(root, Path(folder) / "out", episodes=episodes, **options), "")


def export_on_ray(
    format: Literal["lerobot", "lerobot21", "mcap", "rerun"],
    root: str | Path,
    out: str | Path,
    *,
    address: str = "local",
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Path:
    """Writes a recording in the format of another program, on Ray. The result is that of ``export_FORMAT``.

    Of ``lerobot`` and ``lerobot21``, workers compute the statistics of images, which take most of the time, and the driver writes the
    files. Of ``mcap`` and ``rerun``, workers write the files of their episodes.

    Args:
        format: Name of the format.
        root: A recording that all workers see: a path, an index, or an address.
        out: Output, which must not exist. Of ``mcap`` and ``rerun`` a path that all workers see.
        address: ``local`` for a cluster of this machine's CPUs, ``auto``, or the address of a cluster.
        runtime_env: Ray's runtime environment.
        progress: Called with the number of written episodes and of all episodes.
        options: Further arguments of ``export_FORMAT``.

    Raises:
        ValueError: The format is one file, which one process writes: ``robomimic``, ``rlds``, ``zarr``; or ``trim_idle`` is True.
    """
    if format not in ("lerobot", "lerobot21", "mcap", "rerun"):
        raise ValueError(f"export on Ray writes lerobot, lerobot21, mcap and rerun; {format} is written by one process: leave out --ray")
    if options.get("trim_idle"):
        raise ValueError("export on Ray does not trim episodes; leave out --ray, or trim_idle (--trim-idle)")
    options["map"] = Mapping.of(options.get("map"))  # a file need not be on the workers
    check_pickle("export", options)
    chosen = {name: options[name] for name in ("map", "episodes", "success") if name in options}
    source = Source(root, **chosen)
    with cluster(address, runtime_env) as ray:
        if format in ("mcap", "rerun"):
            if Path(out).exists():
                raise FileExistsError(f"{out} exists; name another output, or delete it")
            positions = [episode.index for episode in source.episodes]
            rest = {name: value for name, value in options.items() if name not in ("episodes", "success")}
            part = Path(out).absolute().with_name(f"{Path(out).name}.part")
            chunks = [positions[n : n + _CHUNK] for n in range(0, len(positions), _CHUNK)]
            done = 0
            with running(ray, _export_files, [(format, _absolute(root), str(part), chunk, rest) for chunk in chunks]) as tasks:
                while (ended := tasks.wait()) or tasks.count:
                    done += sum(len(arguments[3]) for arguments, _ in ended)
                    if progress is not None and ended:
                        progress(done, len(positions))
            part.rename(out)
            return Path(out)
        local, _ = resolved(root)
        frames: int | Literal["key"] = options.get("statistics_frames", 0)
        colour = [camera for camera in source.cameras if len(source.video(source.episodes[0], camera).shape) == 4]
        wanted = [[(str(source.video(e, camera).path.relative_to(local)), e.length - 1) for e in source.episodes[n : n + _CHUNK] for camera in colour]
                  for n in range(0, len(source), _CHUNK)]  # fmt: skip
        found: dict[str, tuple[np.ndarray, int]] = {}
        with running(ray, _histograms_of, [(_absolute(root), videos, frames) for videos in wanted]) as tasks:

            def histograms(path: Path, length: int, frames: int | Literal["key"]) -> tuple[np.ndarray, int]:
                name = str(path.relative_to(local))
                while name not in found:
                    for (_, videos, _), results in tasks.wait():
                        found.update(zip((name for name, _ in videos), results))
                return found.pop(name)

            function = {"lerobot": export_lerobot, "lerobot21": export_lerobot21}[format]
            return function(root, out, progress=progress, histograms=histograms, **options)
