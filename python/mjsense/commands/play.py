# SPDX-License-Identifier: Apache-2.0
"""``mjsense play``"""

from __future__ import annotations

import argparse

from mjsense.commands._page import add_page
from mjsense.commands.parser import Parser, field_values

EXAMPLES = [
    ("mjsense play pick", "Drive the Franka until an object is lifted, and record it into demonstrations/."),
    ("mjsense play pick_and_place --robot i2rt_yam --episodes 10 --out mine", "Record ten demonstrations with another robot."),
    ("mjsense play open --device spacemouse", "Drive with a SpaceMouse."),
]


def add_arguments(parser: Parser) -> None:
    parser.add_argument("task", help="Name of the task.")
    parser.add_argument("--robot", help="Name or .toml of the robot; by default the task's.")
    parser.add_argument("--scene", default="", help="Name or file of the scene; by default the task's.")
    parser.add_argument("--out", default="demonstrations", help="Output directory; by default demonstrations.")
    parser.add_argument("--keep-failures", action="store_true", help="Keep failed episodes too.")
    parser.add_argument(
        "--device",
        choices=("keyboard", "spacemouse"),
        default="keyboard",
        help="Input device, in addition to the handle on the page.",
    )
    parser.add_argument("--arm", default="arm", help="Move group that is driven; by default arm.")
    parser.add_argument("--gripper", default="gripper", help="Move group that is opened and closed; by default gripper.")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="Random seed of the starts.")
    add_page(parser)
    parser.add_fields("FilesCfg")
    parser.add_fields("ImageCfg")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.commands import FAILED
    from mjsense.tasks.teleoperation import play

    names = ("out", "scene", "keep_failures", "device", "arm", "gripper", "seed", "host", "port")
    given = {name: getattr(arguments, name) for name in names}
    given |= field_values(arguments, "FilesCfg") | field_values(arguments, "ImageCfg")
    summary = play(arguments.task, arguments.robot, open_browser=not arguments.no_open, **given)
    print(f"{summary.kept} of {summary.wanted} episodes are in {summary.path}.")
    return 0 if summary.enough else FAILED
