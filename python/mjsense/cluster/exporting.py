# SPDX-License-Identifier: Apache-2.0
"""Export of recordings on Ray."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np

from mjsense.cluster.tasks import check_pickle, cluster, running
from mjsense.dataset.remote import absolute, resolved
from mjsense.export import export_lerobot, export_lerobot21, mcap, rerun, rlds, robomimic, zarr
from mjsense.export.frame_statistics import DEFAULT_FRAMES, frame_histograms
from mjsense.export.mapping import Mapping, Source
from mjsense.export.output import new_output

_CHUNK = 16  # episodes of one task
_PARTS: dict[str, ModuleType] = {"mcap": mcap, "rerun": rerun, "rlds": rlds, "robomimic": robomimic, "zarr": zarr}
"""Formats whose episodes are written by workers. Their modules have the functions ``write`` and ``join``."""
_WHOLE = {"lerobot": export_lerobot, "lerobot21": export_lerobot21}
"""Formats of which workers compute only the statistics of images."""


def export_on_ray(
    format: Literal["lerobot", "lerobot21", "mcap", "rerun", "rlds", "robomimic", "zarr"],
    root: str | Path,
    out: str | Path,
    *,
    address: str = "local",
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Path:
    """Writes a recording in the format of another program, on Ray. The result is that of ``export_FORMAT``.

    Of ``lerobot`` and ``lerobot21``, workers compute the statistics of images, which take most of the time if they use all frames, and the
    driver writes the files. Of the other formats, workers decode and write parts with some episodes each in the folder ``OUT.parts``, and
    the driver joins them without encoding the data again.

    Args:
        format: Name of the format.
        root: A recording that all workers see: a path, an index, or an address.
        out: Output, which must not exist. Unless the format is LeRobot's, a path that all workers see.
        address: ``local`` for a cluster of this machine's CPUs, ``auto``, or the address of a cluster.
        runtime_env: Ray's runtime environment.
        progress: Called with the number of written episodes and of all episodes.
        options: Further arguments of ``export_FORMAT``.

    Returns:
        ``out``.
    """
    if format not in {**_PARTS, **_WHOLE}:
        raise ValueError(f"export on Ray: unknown format '{format}'; the formats are {', '.join(sorted({**_PARTS, **_WHOLE}))}")
    if options.get("trim_idle"):
        raise ValueError("export on Ray does not trim episodes; leave out --ray, or trim_idle (--trim-idle)")
    options["map"] = Mapping.of(options.get("map"))  # a file need not be on the workers
    check_pickle("export", options)
    source = Source(absolute(root), **{name: options[name] for name in ("map", "episodes", "success") if name in options})
    with cluster(address, runtime_env) as ray:
        if format in _WHOLE:
            return _export_whole(ray, format, root, out, source, options, progress)
        rest = {name: value for name, value in options.items() if name not in ("map", "episodes", "success")}
        return _export_parts(ray, format, Path(out), source, rest, progress)


def _export_parts(ray: Any, format: str, out: Path, source: Source, options: dict[str, Any], progress: Callable[[int, int], None] | None) -> Path:
    if out.exists():
        raise FileExistsError(f"{out} exists; name another output, or delete it")
    folder = out.absolute().with_name(f"{out.name}.parts")
    shutil.rmtree(folder, ignore_errors=True)
    ends = [*range(_CHUNK, len(source), _CHUNK), len(source)]
    calls = [(format, source.part(begin, end), str(folder / str(end)), options) for begin, end in zip([0, *ends], ends)]

    def parts(written: Iterator[Any]) -> Iterator[Path]:
        """The parts in their order, which are deleted when the next one is wanted."""
        there: set[str] = set()
        for end, (_, _, path, _) in zip(ends, calls):
            while path not in there:
                there.add(next(written)[0][2])
            yield Path(path)
            _delete(Path(path))
            if progress is not None:
                progress(end, len(source))

    try:
        with running(ray, _write_part, calls, lambda format, part, *_: f"The export of the episodes {_numbers(part)} to {format}") as tasks:
            _PARTS[format].join(source, parts(iter(tasks)), out)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return out


def _numbers(source: Source) -> str:
    return f"{source.episodes[0].index} to {source.episodes[-1].index}"


def _delete(path: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def _write_part(format: str, source: Source, out: str, options: dict[str, Any]) -> None:
    """Writes some episodes to a local file or folder, and copies it to a path that exists when it is complete."""
    with tempfile.TemporaryDirectory(prefix="mjsense_export_") as folder:
        local = Path(folder) / "part"
        _PARTS[format].write(source, local, **options)
        if not Path(out).exists():  # left by a worker that died after it
            with new_output(out) as path:
                shutil.copytree(local, path) if local.is_dir() else shutil.copyfile(local, path)


def _export_whole(ray: Any, format: str, root: str | Path, out: str | Path, source: Source, options: dict[str, Any],
                  progress: Callable[[int, int], None] | None) -> Path:  # fmt: skip
    local, _ = resolved(root)
    local = local.absolute()
    frames: int | Literal["key"] = options.get("statistics_frames", DEFAULT_FRAMES)
    colour = [camera for camera in source.cameras if len(source.video(source.episodes[0], camera).shape) == 4]
    wanted = [[(str(source.video(e, camera).path.relative_to(local)), e.length - 1) for e in source.episodes[n : n + _CHUNK] for camera in colour]
              for n in range(0, len(source), _CHUNK)]  # fmt: skip
    found: dict[str, tuple[np.ndarray, int]] = {}
    calls = [(absolute(root), videos, frames) for videos in wanted]
    with running(ray, _histograms_of, calls, lambda root, videos, *_: f"The statistics of {videos[0][0]} and the following videos") as tasks:
        ended = iter(tasks)

        def histograms(path: Path, length: int, frames: int | Literal["key"]) -> tuple[np.ndarray, int]:
            name = str(path.absolute().relative_to(local))
            while name not in found:
                (_, videos, _), results = next(ended)
                found.update(zip((name for name, _ in videos), results))
            return found.pop(name)

        return _WHOLE[format](root, out, progress=progress, histograms=histograms, **options)


def _histograms_of(root: str, videos: Iterable[tuple[str, int]], frames: int | Literal["key"]) -> list[tuple[np.ndarray, int]]:
    """Histograms of videos, given by their paths relative to the recording and their numbers of frames."""
    local, remote = resolved(root)
    found = []
    for name, length in videos:
        if remote is not None:
            remote.fetch((local / name).parent)
        found.append(frame_histograms(local / name, length, frames))
    return found
