# SPDX-License-Identifier: Apache-2.0
"""``mjsense evaluate``"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from mjsense.commands._policy import add_policy_options, policy_options
from mjsense.commands._ray import add_ray
from mjsense.commands.parser import Parser, add_name, add_no_terminate, complete, field_values

if TYPE_CHECKING:
    from mjsense.tasks.record_job import RecordProgress

EXAMPLES = [
    (
        "mjsense evaluate pick --policy net.py:Network --episodes 100 --out results",
        "Evaluate a policy written in Python on 100 episodes.",
    ),
    ("mjsense evaluate benchmark:pick --policy planner --out results", "Evaluate the planner on a benchmark of the package."),
]
_NOT_OFFERED = tuple(
    """
    noise keep_failures episodes append max_attempts num_attempts first_attempt attempts shard terminate_upon_success
    """.split()
)
_POLICIES = "planner, random, replay:DIR, lerobot:DIR, python:MODULE:CLASS, FILE.py:CLASS, ws://HOST:PORT"


def add_arguments(parser: Parser) -> None:
    add_name(
        parser,
        "task",
        "tasks",
        "Name of the task, or a benchmark: its folder, or benchmark:pick and similar.",
        nargs="?",
        default="pick",
        metavar="TASK",
    )
    action = parser.add_argument(
        "--policy", default="planner", metavar="TEXT", help=f"The policy: {_POLICIES}, or the name of another one."
    )
    setattr(complete(action, ("planner", "random")), "shown_default", "planner")  # noqa: B010  # argparse has no such attribute
    add_policy_options(parser)
    action = parser.add_argument(
        "--adapter",
        metavar="TEXT",
        help="Names and conventions of the messages to ws://HOST:PORT: droid, features, or a TOML file. Not needed "
        "if the server is mjsense serve.",
    )
    complete(action, ("droid", "features", "streams"))
    parser.add_argument(
        "--episodes",
        metavar="N",
        dest="numbers",
        help="Number of episodes, those from 0 on; or their numbers: 3,7,12. By default 50. A benchmark states its episodes.",
    )
    parser.add_argument(
        "--execution-horizon",
        type=int,
        metavar="N",
        help="Number of actions of a chunk that are executed before the policy is called again; by default all.",
    )
    parser.add_argument(
        "--ensemble",
        type=float,
        metavar="FLOAT",
        help="Execute the mean of all chunks that have an action for the step, with the weights "
        "exp(-FLOAT * i), i = 0 for the oldest.",
    )
    parser.add_argument(
        "--latency",
        metavar="SECONDS",
        default="0",
        help="Time from an observation until the actions that answer it are executed; measured: the time that the policy needs.",
    )
    parser.add_argument(
        "--vary",
        metavar="NAMES",
        help="Evaluate on the same episodes again with each of these factors, one at a time: light, camera, texture, "
        "distractors, instruction, start, latency=SECONDS; separated by commas. light=0.5 changes half as much, "
        "distractors=5 is the number of objects.",
    )
    add_no_terminate(parser)
    parser.add_fields("RecordJobCfg", ("task", "policy"), _NOT_OFFERED)
    parser.add_set_options()
    add_ray(parser, "Evaluate")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.commands.output import tell
    from mjsense.core.progress_line import ProgressLine
    from mjsense.evaluation.playing import play
    from mjsense.evaluation.varied import play_varied
    from mjsense.tasks.record_job import of_recording

    options = {"terminate_upon_success": True, **field_values(arguments, "RecordJobCfg"), "task": arguments.task}
    if not options.get("out"):
        raise ValueError("evaluate: the output directory is missing: pass --out DIR")
    options["num_worlds"] = options.pop("worlds", 4)
    if arguments.numbers is not None:
        options["episodes"] = _episodes(arguments.numbers)
    options.pop("policy")
    adapter = {} if arguments.adapter is None else {"adapter": arguments.adapter}
    line = None if arguments.quiet else ProgressLine()

    def show(now: RecordProgress) -> None:
        if line is not None:
            line.show(of_recording(now), now.succeeded + now.failed)

    given: dict[str, Any] = {
        "policy_options": policy_options(arguments.policy_options) | adapter,
        "execution_horizon": arguments.execution_horizon,
        "ensemble": arguments.ensemble,
        "latency": "measured" if arguments.latency == "measured" else _seconds(arguments.latency),
        "ray": arguments.ray,
        "progress": show,
    }
    found: Any
    try:
        if arguments.vary is None:
            found = play(options, arguments.policy, **given)
        else:
            found = play_varied(options, arguments.policy, arguments.vary.split(","), **given)
    except Exception as error:
        if line is not None:
            line.end()
        for note in getattr(error, "__notes__", ()):
            tell(note)
        raise
    finally:
        if line is not None:
            line.end()
    if not arguments.quiet:
        print(found)
        tell(f"Wrote results.parquet and report.html into {options['out']}{'/*' if arguments.vary else ''}.")
    return 0


def _episodes(text: str) -> int | list[int]:
    if text.isdecimal():
        return int(text)
    numbers = text.split(",")
    if not all(number.isdecimal() for number in numbers):
        raise ValueError(f"--episodes is '{text}': must be a number, or numbers such as 3,7,12")
    return [int(number) for number in numbers]


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"--latency is '{text}': must be seconds, or measured") from None
