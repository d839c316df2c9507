# SPDX-License-Identifier: Apache-2.0
"""``mjsense import``"""

from __future__ import annotations

import argparse

from mjsense.commands.parser import Parser, add_episodes, episodes_of, field_values

EXAMPLES = [
    ("mjsense import robomimic demo.hdf5 data", "Write a data set of robomimic or robosuite as a recording."),
    (
        "mjsense import robomimic demo.hdf5 data --episodes 0 1 --assets venv/lib/python3.11/site-packages/robosuite",
        "Import two demonstrations with robosuite's meshes from this folder.",
    ),
    (
        "mjsense import robomimic open_drawer_demo.hdf5 data --without-model",
        "Import LIBERO's demonstrations without its package: all but replay.",
    ),
    ("mjsense import lerobot pusht data", "Write a LeRobot v3.0 data set as a recording."),
    (
        "mjsense import lerobot so100 data --scene so100.xml --joints 1 2 3 4 5 6",
        "Set its states in a scene, so that it can be rendered again.",
    ),
]


def add_arguments(parser: Parser) -> None:
    parser.add_argument("format", choices=["robomimic", "lerobot"], help="Format of IN.")
    parser.add_argument(
        "path", metavar="IN", help="robomimic: HDF5 file with demonstrations; lerobot: folder of a v3.0 data set."
    )
    parser.add_argument("out", metavar="OUT", help="Output folder.")
    add_episodes(parser, "Positions of demonstrations or episodes, such as 3 17 or 0-9,12; by default all.")
    parser.add_argument(
        "--fps", type=float, metavar="HZ", help="robomimic: steps per second; by default that of the file, or 20."
    )
    parser.add_argument(
        "--assets", metavar="DIR", help="robomimic: folder of the package robosuite; by default the installed one."
    )
    parser.add_argument(
        "--without-model",
        action="store_true",
        default=None,
        help="robomimic: leave the models of the demonstrations out, for example those with files of another machine.",
    )
    parser.add_argument(
        "--scene", metavar="FILE", help="lerobot: MJCF in which the numbers of observation.state are set as positions of joints."
    )
    parser.add_argument(
        "--joints",
        nargs="+",
        metavar="NAME",
        help="lerobot: joint of each number of observation.state, '' for none; by default the names of the numbers.",
    )
    parser.add_fields("FilesCfg", skip=("episodes", "append", "overwrite", "house", "resume", "molmospaces_depth"))
    setattr(parser.option("--crf"), "shown_default", "25; lerobot: 18")  # noqa: B010  # argparse declares no such attribute


def run(arguments: argparse.Namespace) -> int:
    options = {"robomimic": ("fps", "assets", "without_model"), "lerobot": ("scene", "joints")}
    others = [
        name
        for kind, names in options.items()
        for name in names
        if kind != arguments.format and getattr(arguments, name) is not None
    ]
    if others:
        raise ValueError(f"--{others[0].replace('_', '-')} is not an option of the format {arguments.format}")
    given = field_values(arguments, "FilesCfg") | {name: getattr(arguments, name) for name in options[arguments.format]}
    given["episodes"] = episodes_of(arguments)
    if arguments.format == "robomimic":
        from mjsense.dataset.import_robomimic import import_robomimic

        import_robomimic(arguments.path, arguments.out, model=not given.pop("without_model"), **given)
    else:
        from mjsense.dataset.import_lerobot import import_lerobot

        import_lerobot(arguments.path, arguments.out, **given)
    print(f"Wrote {arguments.out}.")
    return 0
