# SPDX-License-Identifier: Apache-2.0
"""The commands of the program, their modules and parsers."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjsense.commands.parser import Parser

COMMANDS = {
    "record": "Record episodes of a task.",
    "evaluate": "Evaluate a policy: play episodes, record them, count successes.",
    "serve": "Offer a policy to programs that speak openpi's protocol.",
    "benchmark": "Fix the episodes of an evaluation in a folder, or check them.",
    "sensors": "List the sensors of a scene or task: shapes, units, frames and cost.",
    "scan": "Write the point cloud that a lidar measures in a scene.",
    "inspect": "Show the contents and statistics of a recording.",
    "verify": "Check that a recording is complete and undamaged.",
    "repair": "Publish the finished episodes of an interrupted recording.",
    "tasks": "List the tasks and what they need.",
    "robots": "List the robots.",
    "scenes": "List the scenes and what they need.",
    "objects": "List the objects for scenes, their source and their licence.",
    "schema": "Print all configurations and their fields as JSON.",
    "completion": "Print a shell completion script.",
    "view": "Show a task, a scene, a recording or a model in the browser.",
    "play": "Drive a robot in the browser and record demonstrations.",
    "plot": "Draw streams of recordings or live worlds into a picture.",
    "replay": "Replay recorded episodes and report every difference.",
    "render": "Render recorded episodes with other cameras and sensors.",
    "quality": "Show how recorded episodes were performed: idle share, jerk, approach, visibility.",
    "results": "Show the success rates of an evaluation or recording, and write a table and a report.",
    "compare": "Compare two policies on the same episodes.",
    "dataset": "Delete episodes of recordings, split them, merge them.",
    "export": "Write a recording in the format of another program.",
    "import": "Write a data set of another program as a recording.",
    "assets": "Install the packages with further objects for scenes.",
}
"""Names and one-line descriptions, in the order of ``mjsense --help``."""
_SHARED: dict[str, str] = dict.fromkeys(("tasks", "robots", "scenes", "objects"), "lists")
"""Commands whose module has another name."""

FAILED = 1  # some episodes or checks failed
WRONG_INPUT = 2


def module_of(name: str) -> ModuleType:
    """The module of a command."""
    return importlib.import_module(f"mjsense.commands.{_SHARED.get(name, name)}")


def parser_of(name: str) -> Parser:
    """The argument parser of a command."""
    from mjsense.commands.parser import Parser

    module = module_of(name)
    parser = Parser(name, COMMANDS[name], [(command.replace("{name}", name), why) for command, why in module.EXAMPLES])
    module.add_arguments(parser)
    parser.add_argument(
        "--config", metavar="FILE", help="TOML file with these options; options on the command line take precedence."
    )
    parser.set_defaults(command=name)
    return parser
