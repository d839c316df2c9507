# SPDX-License-Identifier: Apache-2.0
"""The export formats, one line each. A format is a module with these functions:

- ``write(source, path, progress, **options)`` writes the episodes of a :class:`~mjsense.exporting.Source` to ``path``, a file or
  folder that does not exist. The options are those of :data:`OPTIONS` that are named in its line and are not options of the
  source.
- ``join(source, parts, path)`` writes what ``write`` would have written of all episodes, from the outputs of ``write`` for
  consecutive parts of them. Workers of a cluster write the parts. If a module has no such function, one process writes all
  episodes.

This module imports nothing that is slow, because ``mjsense export --help`` reads it before the library is loaded.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from types import ModuleType
from typing import Any, NamedTuple


class Format(NamedTuple):
    """The format of another program."""

    about: str
    """What is written."""
    readers: str
    """The programs that read it, in Markdown."""
    extra: str
    """Extra of mjsense that installs what the module imports."""
    library: str
    """A module that this extra installs."""
    options: tuple[str, ...] = ()
    """Its options, of :data:`OPTIONS`."""
    while_recording: bool = False
    """Whether the module has a class ``Writer``, to which ``mjsense record --format`` gives one episode after the other."""
    module: str = ""
    """Full name of the module that writes it; by default ``mjsense.exporting.NAME``."""


class Option(NamedTuple):
    """A switch of some formats."""

    about: str
    default: bool | None
    """None: the recording decides for each episode."""
    of_source: bool
    """Whether it is an option of the source and not of the format's module."""
    others: str = ""
    """What formats without the option do, for messages."""


OPTIONS = {
    "trim_idle": Option(
        "Leave out the steps in which nothing moves; by default in episodes whose task places an object.",
        default=None,
        of_source=True,
        others="shows episodes with their times",
    ),
    "exact_rate": Option(
        "Keep a rate that is not a whole number, which LeRobot's own tools cannot edit. By default it is rounded "
        "if that changes it "
        "by at most 5 %.",
        default=False,
        of_source=True,
    ),
    "encode_again": Option("Encode videos that have B-frames again, without them.", default=False, of_source=False),
}
"""Options by name: arguments of :func:`mjsense.export` and options of ``mjsense export``."""

_LEROBOT = ("trim_idle", "exact_rate")
FORMATS = {
    "lerobot": Format("LeRobot v3.0", "`lerobot` 0.4 and newer", "export", "pyarrow", _LEROBOT, while_recording=True),
    "lerobot21": Format(
        "LeRobot v2.1 with meta/modality.json, as GR00T reads it", "`lerobot` 0.3, GR00T", "export", "pyarrow", _LEROBOT
    ),
    "robomimic": Format(
        "one HDF5 file of robomimic, with simulator states and models", "robomimic", "robomimic", "h5py", ("trim_idle",)
    ),
    "rlds": Format("RLDS for tensorflow-datasets", "Octo, OpenVLA, openpi", "rlds", "google_crc32c", ("trim_idle",)),
    "zarr": Format("Zarr 2, as Diffusion Policy reads it", "Diffusion Policy", "zarr", "zarr", ("trim_idle",)),
    "rerun": Format("files for the Rerun viewer, one for each episode", "the Rerun viewer", "rerun", "rerun"),
    "mcap": Format(
        "MCAP files with Foxglove's schemas, one for each episode", "Foxglove", "mcap", "mcap_protobuf", ("encode_again",)
    ),
}
"""The formats by name. A module of another package adds its own line,
``FORMATS["name"] = Format(..., module="package.module")``."""


def format_of(name: str) -> Format:
    """The format of a name.

    Raises:
        ValueError: There is no such format.
    """
    if name not in FORMATS:
        from mjsense.core.errors import did_you_mean  # slow to import

        raise ValueError(f"unknown export format '{name}'{did_you_mean(name, FORMATS, 'the formats are')}")
    return FORMATS[name]


def module_of(name: str) -> ModuleType:
    """The module that writes a format, which is imported."""
    return importlib.import_module(format_of(name).module or f"mjsense.exporting.{name}")


def formats_with(option: str) -> list[str]:
    """Names of the formats that have an option."""
    return [name for name, format in FORMATS.items() if option in format.options]


def given_options(name: str, values: dict[str, Any], shown: dict[str, str] | None = None) -> dict[str, Any]:
    """The values of the options of a format, without those that it does not have.

    Args:
        name: Name of the format.
        values: Values by option. One that the format does not have must be False or None.
        shown: Names of options in messages, by default their own.

    Raises:
        ValueError: An option that the format does not have.
    """
    known = format_of(name).options
    for option, value in values.items():
        if value and option not in known:
            others = formats_with(option)
            which = f"the format{'s' if len(others) > 1 else ''} {_listed(others)}"
            why = f"; {name} {OPTIONS[option].others}" if OPTIONS[option].others else ""
            raise ValueError(f"{(shown or {}).get(option, option)} is an option of {which}{why}")
    return {option: value for option, value in values.items() if option in known}


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
