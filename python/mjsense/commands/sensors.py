# SPDX-License-Identifier: Apache-2.0
"""``mjsense sensors``"""

from __future__ import annotations

import argparse
import os
from typing import Any

from mjsense.commands.output import table
from mjsense.commands.parser import Parser, add_name, add_steps, field_values
from mjsense.core.counted import counted

EXAMPLES = [
    ("mjsense sensors embedded:robots/quadruped.xml", "List the sensors of a model that mjsense includes."),
    ("mjsense sensors pick --robot franka --steps 0", "List what a recording of a task contains, without measuring the cost."),
]
ENDS_AT_CTRL_C = True


def add_arguments(parser: Parser) -> None:
    add_name(parser, "what", "tasks", "An MJCF file, embedded:FILE, or the name of a task.", metavar="SCENE.xml|TASK")
    parser.add_fields("RolloutCfg", ("task", "worlds"))
    parser.add_set_options()
    add_steps(parser, "Number of steps over which the cost is measured; 0: do not measure.", 20)
    parser.add_argument("--json", action="store_true", help="Print JSON.")


def names_model(what: str, expected: str) -> bool:
    """Whether ``what`` names a model: an MJCF file, or any name that begins with ``embedded:``; loading it reports the valid
    names.

    Raises:
        ValueError: It looks like the name of a file, and there is no such file.
    """
    if what.startswith("embedded:") or os.path.isfile(what):
        return True
    if os.path.exists(what):
        raise ValueError(f"{what}: is not a file; expected {expected}")
    if os.path.splitext(what)[1]:
        raise ValueError(f"{what}: no such file")
    return False


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense import _core
    from mjsense.core.installed_files import use_installed_meshes

    options = field_values(arguments, "RolloutCfg")
    if names_model(arguments.what, "an MJCF file or the name of a task"):
        if options:
            raise ValueError(f"--{next(iter(options)).replace('_', '-')} applies to tasks only, and {arguments.what} is a scene")
        text = _core.streams_of_scene(arguments.what, arguments.steps)
    else:
        if options.get("meshes") == "real":
            use_installed_meshes()
        text = _core.streams_of_task({**options, "task": arguments.what}, arguments.steps)
    print(text if arguments.json else _table(json.loads(text)))
    return 0


def _table(streams: list[dict[str, Any]]) -> str:
    costs = [stream["microseconds"] for stream in streams]
    rows = [
        [
            s["name"],
            str(tuple(s["shape"])),
            "json" if s["is_dict"] else s["dtype"],
            s["unit"],
            s["frame"],
            str(s["bytes"]),
            _cost(cost),
        ]
        for s, cost in zip(streams, costs)
    ]
    total = sum(filter(None, costs))
    rows.append([counted(len(streams), "stream"), "", "", "", "", str(sum(s["bytes"] for s in streams)), _cost(total or None)])
    return table(("name", "shape", "dtype", "unit", "frame", "bytes", "us/step"), rows, right=(5, 6))


def _cost(microseconds: float | None) -> str:
    return "" if microseconds is None else f"{microseconds:.{2 if microseconds < 10 else 1 if microseconds < 1000 else 0}f}"
