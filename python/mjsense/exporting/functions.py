# SPDX-License-Identifier: Apache-2.0
"""Export of a recording in one of the formats of :data:`mjsense.exporting.FORMATS`."""

from __future__ import annotations

import inspect
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


def _export_to(name: str) -> Callable[..., Path]:
    """:func:`export` to one format. The options of the format are arguments of the function."""
    format = format_of(name)

    def function(root: str | Path, out: str | Path, **options: Any) -> Path:
        return export(root, out, format=name, **options)

    shared = [p for p in inspect.signature(export).parameters.values() if p.name not in ("format", "options")]
    own = [
        inspect.Parameter(option, inspect.Parameter.KEYWORD_ONLY, default=OPTIONS[option].default, annotation="bool | None")
        for option in format.options
    ]
    function.__name__ = function.__qualname__ = f"export_{name}"
    function.__doc__ = (
        f"Writes a recording as {format.about}. The arguments are those of :func:`mjsense.export` and the format's options."
    )
    function.__signature__ = inspect.Signature([*shared, *own], return_annotation="Path")  # pyright: ignore[reportFunctionMemberAccess]
    return checked(function)


export_lerobot = _export_to("lerobot")
"""Writes a recording as a LeRobot v3.0 data set."""
export_lerobot21 = _export_to("lerobot21")
"""Writes a recording as a LeRobot v2.1 data set with ``meta/modality.json``."""
export_robomimic = _export_to("robomimic")
"""Writes a recording as one HDF5 file of robomimic, with simulator states and the model of each demonstration if the recording
has data for replay. Images are decoded, because robomimic reads arrays."""
export_rlds = _export_to("rlds")
"""Writes a recording as an RLDS data set, which ``tfds.builder(out.name, data_dir=out.parent)`` reads. Images are stored as PNG.
The name of ``out`` is that of the data set: small letters, digits and ``_``."""
export_zarr = _export_to("zarr")
"""Writes a recording as a Zarr 2 folder: arrays of all steps of all episodes in ``data``, and ``meta/episode_ends``, as Diffusion
Policy's ``ReplayBuffer`` reads them. Images are decoded."""
export_rerun = _export_to("rerun")
"""Writes a recording as a folder of ``.rrd`` files, one for each episode, which ``rerun OUT/*.rrd`` shows: the videos as they
are, depth images, features as curves, and, if the recording has data for replay, the geoms of the scene."""
export_mcap = _export_to("mcap")
"""Writes a recording as a folder of MCAP files, one for each episode, which Foxglove and Rerun show: H.264 videos, depth images,
calibrations, poses of cameras and of the model's bodies, joint states, and features as JSON messages. Raises ValueError if a
video has B-frames and ``encode_again`` is False."""
