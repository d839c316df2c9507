# SPDX-License-Identifier: Apache-2.0
"""``mjsense import``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense import robomimic demo.hdf5 data", "Write a data set of robomimic or robosuite as a recording."),
    ("mjsense import robomimic demo.hdf5 data --episodes 0 1 --assets venv/lib/python3.11/site-packages/robosuite",
     "Import two demonstrations with robosuite's meshes from this folder."),
]  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("format", choices=["robomimic"], help="Format of IN.")
    parser.add_argument("path", metavar="IN", help="HDF5 file with demonstrations.")
    parser.add_argument("out", metavar="OUT", help="Output folder.")
    parser.add_argument("--episodes", type=int, nargs="+", metavar="N", help="Positions of demonstrations; by default all.")
    parser.add_argument("--fps", type=float, metavar="HZ", help="Steps per second; by default that of the file, or 20.")
    parser.add_argument("--assets", metavar="DIR", help="Folder of the package robosuite; by default the installed one.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.dataset.import_robomimic import import_robomimic

    import_robomimic(arguments.path, arguments.out, episodes=arguments.episodes, fps=arguments.fps, assets=arguments.assets)
    return 0
