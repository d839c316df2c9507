# SPDX-License-Identifier: Apache-2.0
"""``mjsense plot``"""

from __future__ import annotations

import argparse

from mjsense.commands.parser import positions

EXAMPLES = [
    ("mjsense plot data --stream tcp_pose qpos/arm", "Draw two streams of the first episode."),
    (
        "mjsense plot data --stream obj_start wrist_camera --episode 0 1 --out two.png",
        "Two episodes, with a film strip of a camera.",
    ),
    ("mjsense plot pick --stream tcp_pose --seconds 5", "Play a task for five seconds."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", help="A recording, or a task, a scene or an MJCF that is stepped: its name or path.")
    parser.add_argument(
        "--stream", nargs="+", required=True, metavar="NAME", help="Streams by name, last part of a name, or pattern."
    )
    parser.add_argument(
        "--episode",
        type=positions,
        nargs="+",
        default=[[0]],
        metavar="I",
        help="Positions of episodes in the recording, such as 3 17 or 0-9,12; by default the first.",
    )
    parser.add_argument("--world", type=int, default=0, metavar="K", help="World to draw, of live worlds.")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="How long live worlds are stepped, s.")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="Seed of live worlds.")
    parser.add_argument("--robot", help="Name or .toml of a live task's robot; by default the task's.")
    parser.add_argument("--scene", help="Name or file of a live task's scene; by default the task's.")
    parser.add_argument("--out", default="plot.png", metavar="FILE", help="File to write: PNG, PDF or SVG; by default plot.png.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.viewer.open import options_of
    from mjsense.viewer.plots import plot

    options = options_of({"robot": arguments.robot, "scene": arguments.scene})
    plot(
        arguments.what,
        arguments.stream,
        episodes=[one for part in arguments.episode for one in part],
        world=arguments.world,
        seconds=arguments.seconds,
        seed=arguments.seed,
        out=arguments.out,
        **options,
    )
    print(f"Wrote {arguments.out}.")
    return 0
