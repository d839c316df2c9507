# SPDX-License-Identifier: Apache-2.0
"""Export of a recording in one of the formats of :data:`mjsense.exporting.FORMATS`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mjsense.core.arguments import checked
from mjsense.core.errors import unexpected_keyword
from mjsense.core.new_output import new_output
from mjsense.exporting.formats import OPTIONS, format_of, given_options, module_of
from mjsense.exporting.mapping import Mapping, Source


@checked
def export(
    root: str | Path,
    out: str | Path,
    *,
    format: str,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: bool | None,
) -> Path:
    """Writes a recording in the format of another program. See docs/export.md.

    Args:
        root: Recording: its folder, one of its ``house_N`` folders, or one HDF5 file.
        out: File or folder to write. It must not exist.
        format: Name of the format, one of :data:`mjsense.exporting.FORMATS`.
        map: Features and cameras: a :class:`mjsense.exporting.Mapping`, a TOML file, or a dict of the same form.
        episodes: Positions of episodes in the recording; by default all.
        success: Only successful (True) or only failed (False) episodes.
        progress: Called with the number of written episodes and of all episodes.
        options: Options of the format, of :data:`mjsense.exporting.OPTIONS`, such as ``trim_idle``.

    Returns:
        ``out``.

    Raises:
        ValueError: There is no such format, or it does not have one of the options.
        FileExistsError: ``out`` exists.
    """
    source, own = source_of(format, root, {"map": map, "episodes": episodes, "success": success}, options)
    with new_output(out) as path:
        module_of(format).write(source, path, progress, **own)
    return Path(out)


def source_of(format: str, root: str | Path, chosen: dict[str, Any], options: dict[str, Any]) -> tuple[Source, dict[str, Any]]:
    """What an export reads, after its notes were printed, and the options of the format's ``write``.

    Args:
        chosen: ``map``, ``episodes`` and ``success``.
        options: Options of the format.
    """
    if unknown := [name for name in options if name not in OPTIONS]:
        raise unexpected_keyword("export()", unknown[0], ["format", "map", "episodes", "success", "progress", *OPTIONS])
    given = given_options(format, options)
    of_source: dict[str, Any] = {}
    if "trim_idle" in format_of(format).options:
        of_source["trim_idle"] = given.get("trim_idle")
    if "exact_rate" in format_of(format).options:
        of_source["whole_rate"] = not given.get("exact_rate", False)
    source = Source(root, **chosen, **of_source)
    source.print_notes()
    return source, {name: value for name, value in given.items() if not OPTIONS[name].of_source}


@checked
def export_lerobot(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool | None = None,
    exact_rate: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a LeRobot v3.0 data set.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    options = {"trim_idle": trim_idle, "exact_rate": exact_rate}
    return export(root, out, format="lerobot", map=map, episodes=episodes, success=success, progress=progress, **options)


@checked
def export_lerobot21(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool | None = None,
    exact_rate: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a LeRobot v2.1 data set with ``meta/modality.json``.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    options = {"trim_idle": trim_idle, "exact_rate": exact_rate}
    return export(root, out, format="lerobot21", map=map, episodes=episodes, success=success, progress=progress, **options)


@checked
def export_robomimic(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as one HDF5 file of robomimic, with simulator states and the model of each demonstration if the recording has
    data for replay. Images are decoded, because robomimic reads arrays.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    options = {"trim_idle": trim_idle}
    return export(root, out, format="robomimic", map=map, episodes=episodes, success=success, progress=progress, **options)


@checked
def export_rlds(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as an RLDS data set, which ``tfds.builder(out.name, data_dir=out.parent)`` reads. Images are stored as PNG. The name of ``out`` is
    that of the data set: small letters, digits and ``_``.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    return export(root, out, format="rlds", map=map, episodes=episodes, success=success, trim_idle=trim_idle, progress=progress)


@checked
def export_zarr(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    trim_idle: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a Zarr 2 folder: arrays of all steps of all episodes in ``data``, and ``meta/episode_ends``, as Diffusion
    Policy's ``ReplayBuffer`` reads them. Images are decoded.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    return export(root, out, format="zarr", map=map, episodes=episodes, success=success, trim_idle=trim_idle, progress=progress)


@checked
def export_rerun(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a folder of ``.rrd`` files, one for each episode, which ``rerun OUT/*.rrd`` shows: the videos as they are,
    depth images, features as curves, and, if the recording has data for replay, the geoms of the scene.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).
    """
    return export(root, out, format="rerun", map=map, episodes=episodes, success=success, progress=progress)


@checked
def export_mcap(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    encode_again: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a folder of MCAP files, one for each episode, which Foxglove and Rerun show: H.264 videos, depth images,
    calibrations, poses of cameras and of the model's bodies, joint states, and features as JSON messages.

    The arguments are those of :func:`mjsense.export`, and options of the format (:data:`mjsense.exporting.OPTIONS`).

    Raises:
        ValueError: A video has B-frames, and ``encode_again`` is False.
    """
    options = {"encode_again": encode_again}
    return export(root, out, format="mcap", map=map, episodes=episodes, success=success, progress=progress, **options)
