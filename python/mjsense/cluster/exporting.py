# SPDX-License-Identifier: Apache-2.0
"""Export of recordings on Ray."""

from __future__ import annotations

import contextlib
import importlib
import shutil
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mjsense.cluster.scratch import scratch_folder
from mjsense.cluster.tasks import check_pickle, cluster, running
from mjsense.core.old_names import old_order
from mjsense.dataset.remote import absolute
from mjsense.exporting.formats import module_of
from mjsense.exporting.functions import export, source_of
from mjsense.exporting.mapping import Mapping, Source
from mjsense.exporting.output import new_output, own_folder

_CHUNK = 16  # episodes of one task


@old_order(
    "export_on_ray(format, root, out)",
    "export_on_ray(root, out, format=...)",
    ("format", "root", "out"),
    lambda given, kwargs: "format" not in kwargs,
)
def export_on_ray(
    root: str | Path,
    out: str | Path,
    *,
    format: str,
    address: str = "local",
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Path:
    """Writes a recording in the format of another program, on Ray. The result is that of :func:`mjsense.export`.

    Workers decode and write parts with some episodes each in the folder ``OUT.parts``, and the driver joins them without encoding
    the data again. The driver writes formats without ``join``, which are LeRobot's, alone and without a cluster: it copies their
    videos, and encodes those of episodes from which idle steps are left out.

    Args:
        root: A recording that all workers see: a path, an index, or an address.
        out: Output, which must not exist. Unless the format is LeRobot's, a path that all workers see.
        format: Name of the format.
        address: ``local`` for a cluster of this machine's CPUs, ``auto``, or the address of a cluster.
        runtime_env: Ray's runtime environment.
        progress: Called with the number of written episodes and of all episodes.
        options: Further arguments of :func:`mjsense.export`.

    Returns:
        ``out``.
    """
    module = module_of(format)
    if not hasattr(module, "join"):
        return export(root, out, format=format, progress=progress, **options)
    options["map"] = Mapping.of(options.get("map"))  # a file need not be on the workers
    check_pickle("export", options)
    chosen = {name: options.pop(name) for name in ("map", "episodes", "success") if name in options}
    source, own = source_of(format, absolute(root), chosen, options)
    with cluster(address, runtime_env) as ray:
        _export_parts(ray, format, Path(out), source, own, progress)
    return Path(out)


def _export_parts(
    ray: Any, format: str, out: Path, source: Source, options: dict[str, Any], progress: Callable[[int, int], None] | None
) -> None:
    if out.exists():
        raise FileExistsError(f"{out} exists; name another output, or delete it")
    with own_folder(out.absolute().with_name(f"{out.name}.parts"), f"another process writes {out}") as folder:
        _join_parts(ray, format, out, folder, source, options, progress)


def _join_parts(
    ray: Any,
    format: str,
    out: Path,
    folder: Path,
    source: Source,
    options: dict[str, Any],
    progress: Callable[[int, int], None] | None,
) -> None:
    module = module_of(format)
    ends = [*range(_CHUNK, len(source), _CHUNK), len(source)]
    calls = [
        (format, module.__name__, source.part(begin, end), str(folder / str(end)), options)
        for begin, end in zip([0, *ends], ends)
    ]

    def parts(written: Iterator[Any]) -> Iterator[Path]:
        """The parts in their order, which are deleted when the next one is wanted."""
        there: set[str] = set()
        for end, (*_, path, _) in zip(ends, calls):
            while path not in there:
                there.add(next(written)[0][3])
            yield Path(path)
            _delete(Path(path))
            if progress is not None:
                progress(end, len(source))

    def described(format: str, _: str, part: Source, *__: Any) -> str:
        return f"The export of the episodes {_numbers(part)} to {format}"

    with running(ray, _write_part, calls, described) as tasks, new_output(out) as path:
        module.join(source, parts(iter(tasks)), path)


def _numbers(source: Source) -> str:
    return f"{source.episodes[0].index} to {source.episodes[-1].index}"


def _delete(path: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def _write_part(format: str, module: str, source: Source, out: str, options: dict[str, Any]) -> None:
    """Writes some episodes to a local file or folder, and copies it to a path that exists when it is complete."""
    with scratch_folder() as folder:
        local = folder / "part"
        importlib.import_module(module).write(source, local, **options)
        if not Path(out).exists():  # left by a worker that died after it
            copy = Path(f"{out}.{uuid.uuid4().hex}")  # in the driver's folder, which deletes it if this worker dies
            shutil.copytree(local, copy) if local.is_dir() else shutil.copyfile(local, copy)
            with contextlib.suppress(OSError):  # another worker was faster
                copy.rename(out)
