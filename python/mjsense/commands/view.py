# SPDX-License-Identifier: Apache-2.0
"""``mjsense view``"""

from __future__ import annotations

import argparse

from mjsense.commands._page import add_page

EXAMPLES = [
    ("mjsense view pick", "Watch the planner play a task."),
    ("mjsense view pick --robot rby1 --scene kitchen --seed 3", "Another robot in another scene."),
    ("mjsense view data", "Look through the episodes of a recording."),
    ("mjsense view robot.xml --port 9000 --no-open", "View a model, and open the page by hand."),
    ("mjsense view data --episode 2 --export episode.viser", "Write an episode to a file that a web page can show."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", help="A task, a scene, a recording or an MJCF: its name or path.")
    parser.add_argument("--robot", help="Name or .toml of the robot; by default the task's.")
    parser.add_argument("--scene", help="Name or file of the scene; by default the task's.")
    parser.add_argument("--task", help="Task that is played in a scene; by default pick.")
    parser.add_argument("--policy", default="planner", help="Name of the policy; by default planner.")
    parser.add_argument("--worlds", type=int, default=1, metavar="N", help="Number of worlds.")
    parser.add_argument("--world", type=int, default=0, metavar="K", help="World to show first.")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="Seed of the first episode.")
    parser.add_argument("--episode", type=int, default=0, metavar="I", help="Position of the recording's episode to show first.")
    add_page(parser)
    parser.add_argument("--export", metavar="FILE", help="Write a .viser or .rrd file instead of showing a page.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="Length of an export of live worlds, s.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.viewer.export import export
    from mjsense.viewer.open import options_of, source_of, viewer_of

    given = {name: getattr(arguments, name) for name in ("robot", "scene", "task", "policy")}
    source = source_of(
        arguments.what, num_worlds=max(arguments.worlds, arguments.world + 1), seed=arguments.seed, **options_of(given)
    )
    place = {"host": arguments.host, "port": arguments.port}
    if arguments.export:
        export(
            source,
            arguments.export,
            world=arguments.world,
            episode=arguments.episode,
            seconds=arguments.seconds,
            progress=False if arguments.quiet else None,
        )
        if not arguments.quiet:
            print(f"Wrote {arguments.export}.")
        return 0
    viewer_of(source, world=arguments.world, episode=arguments.episode, seed=arguments.seed, **place).run(not arguments.no_open)
    return 0
