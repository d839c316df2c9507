# SPDX-License-Identifier: Apache-2.0
"""Export of recordings on Ray."""

from __future__ import annotations

import contextlib
import shutil
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from mjsense.cluster.scratch import scratch_folder
from mjsense.cluster.tasks import check_pickle, cluster, running
from mjsense.dataset.remote import absolute
from mjsense.exporting import export_lerobot, export_lerobot21, mcap, rerun, rlds, robomimic, zarr
from mjsense.exporting.mapping import Mapping, Source
from mjsense.exporting.output import own_folder

_CHUNK = 16  # episodes of one task
_PARTS: dict[str, ModuleType] = {"mcap": mcap, "rerun": rerun, "rlds": rlds, "robomimic": robomimic, "zarr": zarr}
"""Formats whose episodes are written by workers. Their modules have the functions ``write`` and ``join``."""
_WHOLE = {"lerobot": export_lerobot, "lerobot21": export_lerobot21}
"""Formats that the driver writes alone: it copies the videos, and the recording contains the histograms of their images. Only the videos of
episodes from which steps are left out are encoded again."""
_TRIMMED = {"rlds", "robomimic", "zarr"}
"""Formats of workers that leave out idle steps of tasks that place an object, unless ``trim_idle`` says otherwise."""


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

    Workers decode and write parts with some episodes each in the folder ``OUT.parts``, and the driver joins them without encoding the data
    again. The driver writes ``lerobot`` and ``lerobot21`` alone, without a cluster, because it only copies the videos; it encodes those of
    episodes from which idle steps are left out.

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
    if format in _WHOLE:
        return _WHOLE[format](root, out, progress=progress, **options)
    options["map"] = Mapping.of(options.get("map"))  # a file need not be on the workers
    check_pickle("export", options)
    trim_idle = options.pop("trim_idle", None)
    if format not in _TRIMMED:
        if trim_idle:
            raise ValueError(f"export on Ray: trim_idle cannot be combined with the format '{format}', which shows episodes with their times")
        trim_idle = False
    chosen = {name: options.pop(name) for name in ("map", "episodes", "success") if name in options}
    source = Source(absolute(root), **chosen, trim_idle=trim_idle)
    source.print_notes()
    with cluster(address, runtime_env) as ray:
        return _export_parts(ray, format, Path(out), source, options, progress)


def _export_parts(ray: Any, format: str, out: Path, source: Source, options: dict[str, Any], progress: Callable[[int, int], None] | None) -> Path:
    if out.exists():
        raise FileExistsError(f"{out} exists; name another output, or delete it")
    with own_folder(out.absolute().with_name(f"{out.name}.parts"), f"another process writes {out}") as folder:
        return _join_parts(ray, format, out, folder, source, options, progress)


def _join_parts(
    ray: Any, format: str, out: Path, folder: Path, source: Source, options: dict[str, Any], progress: Callable[[int, int], None] | None
) -> Path:
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

    with running(ray, _write_part, calls, lambda format, part, *_: f"The export of the episodes {_numbers(part)} to {format}") as tasks:
        _PARTS[format].join(source, parts(iter(tasks)), out)
    return out


def _numbers(source: Source) -> str:
    return f"{source.episodes[0].index} to {source.episodes[-1].index}"


def _delete(path: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def _write_part(format: str, source: Source, out: str, options: dict[str, Any]) -> None:
    """Writes some episodes to a local file or folder, and copies it to a path that exists when it is complete."""
    with scratch_folder() as folder:
        local = folder / "part"
        _PARTS[format].write(source, local, **options)
        if not Path(out).exists():  # left by a worker that died after it
            copy = Path(f"{out}.{uuid.uuid4().hex}")  # in the driver's folder, which deletes it if this worker dies
            shutil.copytree(local, copy) if local.is_dir() else shutil.copyfile(local, copy)
            with contextlib.suppress(OSError):  # another worker was faster
                copy.rename(out)
