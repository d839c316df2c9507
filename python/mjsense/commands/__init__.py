# SPDX-License-Identifier: Apache-2.0
"""The commands of the ``mjsense`` program that are written in Python, one module each.

A module ``mjsense.commands.NAME`` has ``add_arguments(parser)``, ``run(arguments) -> exit code``, and ``EXAMPLES``: pairs of a command and
its explanation. It imports what it needs in ``run``, so that ``--help`` and completion are fast.
"""

from __future__ import annotations

import argparse
import importlib
import os
import shutil
import sys
import textwrap
from types import ModuleType
from typing import Any

from mjsense.core.errors import did_you_mean

COMMANDS = {
    "view": "Show a task, a scene, a recording or a model in the browser.",
    "play": "Drive a robot in the browser and record demonstrations.",
    "plot": "Draw streams of recordings or live worlds into a picture.",
    "replay": "Replay recorded episodes and report every difference.",
    "render": "Render recorded episodes with other cameras and sensors.",
    "quality": "Show how recorded episodes were performed: idle share, jerk, approach, visibility.",
    "dataset": "Delete episodes of recordings, split them, merge them.",
    "export": "Write a recording in the format of another program.",
    "import": "Write a data set of another program as a recording.",
    "assets": "Install the packages with further objects for scenes.",
}
"""Names and one-line descriptions, in the order of ``mjsense --help``."""

FAILED = 1  # some episodes or checks failed
WRONG_INPUT = 2
_INTERRUPTED = 130  # 128 + SIGINT, as shells report it
_BROKEN_PIPE = 141  # as of a program that SIGPIPE ends


def _width() -> int:
    return min(shutil.get_terminal_size().columns, 100)


class _HelpFormatter(argparse.RawDescriptionHelpFormatter):
    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26, width=_width())


class _Parser(argparse.ArgumentParser):
    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        arguments, rest = super().parse_known_args(*args, **kwargs)
        for name in (word.partition("=")[0] for word in rest if word.startswith("--")):
            raise ValueError(f"no option named '{name}'{did_you_mean(name, self._option_string_actions) or f'; see {self.prog} --help'}")
        return arguments, rest

    def error(self, message: str) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]  # raises instead of exiting
        raise ValueError(f"{message}; see {self.prog} --help")


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"mjsense.commands.{name.replace('-', '_')}")


def parser_of(name: str) -> argparse.ArgumentParser:
    """The argument parser of a command."""
    module = _module(name)
    examples = "\n".join(f"  # {why}\n  {command}" for command, why in module.EXAMPLES)
    parser = _Parser(
        prog=f"mjsense {name}",
        description=textwrap.fill(COMMANDS[name], _width()),
        epilog=f"Examples:\n{examples}",
        formatter_class=_HelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    return parser


def message_of(error: BaseException) -> str:
    """One line for stderr."""
    if isinstance(error, OSError) and error.filename is not None:  # raised by Python: "[Errno 30] Read-only file system: 'out'"
        return f"{error.filename}: {error.strerror}"
    text = error.args[0] if isinstance(error, KeyError) and error.args else error  # str() of a KeyError is a repr
    return " ".join(str(text).split()) or type(error).__name__


def run(words: list[str]) -> int:
    """Runs the command ``words[0]`` with the other words as its arguments. Errors are printed on stderr.

    Returns:
        0: done; 1: some episodes or checks failed; 2: wrong usage or input; 130: interrupted; 141: the reader of the output has ended.
    """
    parser = parser_of(words[0])
    try:
        arguments = parser.parse_args(words[1:])
        code = _module(words[0]).run(arguments)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        hint = "; continue with --resume" if "--resume" in parser._option_string_actions else ""
        print(f"mjsense {words[0]}: interrupted{hint}", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:  # the reader of the output, such as head, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for the flush when Python ends
        return _BROKEN_PIPE
    except (ValueError, LookupError, OSError, RuntimeError, ImportError) as error:
        print(f"mjsense {words[0]}: {message_of(error)}", file=sys.stderr)
        return WRONG_INPUT


def completions(words: list[str]) -> list[str]:
    """Completions of the last of these words, of which the first is a command: option names, or the choices of an option."""
    parser, last = parser_of(words[0]), words[-1]
    options = {name: action for action in parser._actions for name in action.option_strings}
    before = options.get(words[-2]) if len(words) > 2 else None
    if last.startswith("-"):
        found = list(options)
    elif before is not None and before.nargs != 0:
        found = [str(choice) for choice in before.choices or ()]
    else:
        found = [str(c) for action in parser._actions if not action.option_strings for c in action.choices or ()]
    return [name for name in found if name.startswith(last)]
