# SPDX-License-Identifier: Apache-2.0
"""The parser of a command: argparse with the program's help texts and messages, options that are fields, and experiment files."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Collection, Sequence
from typing import Any, NoReturn

from mjsense.commands.fields import Field, find, read_size, suggestion
from mjsense.commands.table import FIELDS, NAMES
from mjsense.core.progress_line import terminal_width

_NAME_COLUMN = 28  # where descriptions begin
_MAX_WIDTH = 100  # longer lines are hard to read
_NAMED = {"robot": "robots", "policy": "policies", "scene": "scenes"}
"""Options that accept names."""
_MAX_STEPS = 1_000_000_000
_NUMBERS = {"int": "a whole number", "float": "a number"}
_POSITIONS = re.compile(r"(\d{1,7})(?:-(\d{1,7}))?", re.ASCII)
_LISTED = ("robot", "policy")  # in the help


def text_width() -> int:
    """Number of columns of help texts and lists."""
    return min(max(terminal_width(sys.stdout), 40), _MAX_WIDTH)


def wrapped(text: str, width: int) -> list[str]:
    """Lines of a text, broken at spaces only. A long word gets a line of its own."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return lines


def entry(name: str, text: str) -> str:
    """A name and its description in a help text."""
    head, rest = f"  {name}", wrapped(text, max(text_width() - _NAME_COLUMN, 24))
    if len(head) + 2 <= _NAME_COLUMN:
        head = head.ljust(_NAME_COLUMN) + rest.pop(0)
    return "\n".join([head.rstrip(), *(" " * _NAME_COLUMN + line for line in rest)]) + "\n"


class Parser(argparse.ArgumentParser):
    """The parser of a command. ``examples``: pairs of a command and its explanation."""

    def __init__(self, name: str, description: str, examples: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__(prog=f"mjsense {name}", description=description, allow_abbrev=False, add_help=False)
        self.name, self._examples = name, examples
        self.fields: list[Field] = []
        """Fields that an experiment file may set; some have no option."""
        self.add_argument("-h", "--help", action="help", help="Print this help and exit.")

    def add_fields(self, struct: str, arguments: Collection[str] = (), skip: Collection[str] = ()) -> None:
        """Adds an option for each field of a configuration. A field that is not given is absent in the parsed arguments.

        Args:
            arguments: Fields that are arguments of the command or chosen by it, by their options.
            skip: Fields that do not apply to the command.
        """
        for field in FIELDS[struct]:
            if field.flag in skip:
                continue
            self.fields.append(field)
            if field.hidden or field.flag in arguments:
                continue
            flag = f"--{'no-' if field.is_on else ''}{field.flag.replace('_', '-')}"
            if field.kind == "bool":
                switch: dict[str, Any] = {"action": "store_const", "const": not field.is_on}
                if field.is_either:
                    switch = {"action": argparse.BooleanOptionalAction}
                self.add_argument(flag, dest=field.name, default=argparse.SUPPRESS, help=field.help, **switch)
                continue
            names = NAMES.get(_NAMED.get(field.flag, ""), ())
            listed = f" One of: {', '.join(names)}." if field.flag in _LISTED else ""
            if field.is_list:
                listed += " Separated by commas; none: an empty list."
            action = self.add_argument(
                flag, dest=field.name, default=argparse.SUPPRESS, metavar=field.metavar, help=field.help + listed
            )
            setattr(action, "field", field)  # noqa: B010  # argparse declares no such attribute
            complete(action, names or field.words)

    def option(self, name: str) -> argparse.Action:
        """An option by its name, such as ``--table``."""
        return self._option_string_actions[name]

    def add_set_options(self) -> None:
        """Adds ``--size`` and ``--set``."""
        self.add_argument("--size", metavar="WxH", help="Width and height of the images.")
        self.add_argument(
            "--set",
            metavar="NAME=VALUE",
            action="append",
            default=[],
            dest="assignments",
            help="Set any field by its name, including fields without an option. May be repeated.",
        )

    # Messages. argparse prints its own and exits.

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        arguments, rest = super().parse_known_args(*args, **kwargs)
        for name in (word.partition("=")[0] for word in rest if word.startswith("--") and word != "--"):
            near = suggestion(name, self._option_string_actions) or f"; see {self.prog} --help"
            raise ValueError(f"{self.name}: no option named '{name}'{near}")
        if rest:
            raise ValueError(f"{self.name}: unexpected argument '{rest[0]}'; see {self.prog} --help")
        return arguments, rest

    def error(self, message: str) -> NoReturn:
        missing = re.fullmatch(r"the following arguments are required: ([^,]*)(, .*)?", message)
        if missing:
            self._missing(next(a for a in self._actions if missing[1] in (a.metavar, a.dest, "/".join(a.option_strings))))
        wrong = re.fullmatch(r"argument (\S+): invalid (int|float) value: (.*)", message, re.DOTALL)
        if wrong:
            message = f"{wrong[1]} is {wrong[3]}: must be {_NUMBERS[wrong[2]]}"
        raise ValueError(f"{message.removeprefix('argument ')}{'' if message.endswith('?') else f'; see {self.prog} --help'}")

    def _missing(self, action: argparse.Action) -> NoReturn:
        name = f"option {action.option_strings[-1]}" if action.option_strings else f"argument '{place_of(action)}'"
        words = ", ".join(map(str, action.choices or ()))
        about = f"one of {words}" if words else (action.help or "").replace("%%", "%").removesuffix(".")
        self.error(f"{self.name}: the {name} is missing: {about}")

    def _match_argument(self, action: argparse.Action, arg_strings_pattern: str) -> int:
        try:
            return super()._match_argument(action, arg_strings_pattern)  # pyright: ignore[reportAttributeAccessIssue]
        except argparse.ArgumentError:
            if not action.option_strings:
                self._missing(action)
            self.error(f"{action.option_strings[-1]}: the value is missing, {type_of(action)}")

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        field = getattr(action, "field", None)
        if field is None:
            return super()._get_value(action, arg_string)  # pyright: ignore[reportAttributeAccessIssue]
        return field.of_text(arg_string, action.option_strings[0])

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            name = action.option_strings[-1] if action.option_strings else action.dest
            words = ", ".join(map(str, action.choices))
            self.error(f"{name} is '{value}': must be one of {words}{suggestion(str(value), map(str, action.choices))}")

    # Help.

    def format_help(self) -> str:
        options = [action for action in self._actions if action.option_strings]
        places = [action for action in self._actions if not action.option_strings]
        words = "".join(f" [{place_of(one)}]" if one.nargs in ("?", "*") else f" {place_of(one)}" for one in places)
        parts = ["\n".join(wrapped(self.description or "", text_width())), f"Usage: {self.prog} [OPTIONS]{words}"]
        for title, actions in (("Arguments", places), ("Options", options)):
            if actions:
                parts.append(f"{title}:\n" + "".join(map(_help_of, actions)).rstrip("\n"))
        if self._examples:
            parts.append("Examples:\n" + "\n".join(f"  # {why}\n  {command}" for command, why in self._examples))
        return "\n\n".join(parts) + "\n"

    def print_help(self, file: Any = None) -> None:
        sys.stdout.write(self.format_help())


def add_name(parser: Parser, dest: str, names: str, text: str, **options: Any) -> None:
    """Adds an argument that names a task, for example. ``options``: those of ``add_argument``."""
    action = parser.add_argument(dest, help=f"{text} One of: {', '.join(NAMES[names])}.", **options)
    complete(action, NAMES[names])
    setattr(action, "shown_default", options.get("default"))  # noqa: B010


def add_no_terminate(parser: Parser) -> None:
    """Adds ``--no-terminate-upon-success`` for commands in which an episode ends at its first success."""
    parser.add_argument(
        "--no-terminate-upon-success",
        dest="terminate_upon_success",
        action="store_const",
        const=False,
        default=argparse.SUPPRESS,
        help="Do not end an episode at its first success: the last observation decides.",
    )


def add_steps(parser: Parser, text: str, default: int) -> None:
    """Adds ``--steps``."""

    def steps(given: str) -> int:
        if not given.isdecimal() or int(given) > _MAX_STEPS:
            raise argparse.ArgumentTypeError(f"Value {given} not in range 0 to {_MAX_STEPS}")
        return int(given)

    setattr(steps, "kind", int)  # noqa: B010
    action = parser.add_argument("--steps", type=steps, default=default, metavar="INT", help=text)
    setattr(action, "shown_default", str(default))  # noqa: B010


def positions(text: str) -> list[int]:
    """The numbers of a text such as ``0-9,12``."""
    numbers: list[int] = []
    for part in text.split(","):
        found = _POSITIONS.fullmatch(part)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (1, 0)
        if last < first:
            raise argparse.ArgumentTypeError(f"'{text}': expected numbers such as 3, or 0-9,12")
        numbers += range(first, last + 1)
    return numbers


setattr(positions, "kind", int)  # noqa: B010  # in an experiment file


def add_episodes(parser: argparse.ArgumentParser, text: str) -> None:
    """Adds ``--episodes``, which ``episodes_of`` reads."""
    parser.add_argument("--episodes", type=positions, nargs="+", metavar="N", help=text)


def episodes_of(arguments: argparse.Namespace) -> list[int] | None:
    """The positions of ``--episodes``, or None if it is not given."""
    return None if arguments.episodes is None else [one for part in arguments.episodes for one in part]


def field_values(arguments: argparse.Namespace, struct: str) -> dict[str, Any]:
    """The fields of a configuration that are given, by their names in Python."""
    fields = FIELDS[struct]
    values = {field.name: getattr(arguments, field.name) for field in fields if hasattr(arguments, field.name)}
    if getattr(arguments, "size", None) is not None:
        values |= read_size(fields, arguments.size)
    for assignment in getattr(arguments, "assignments", ()):
        name, equals, text = assignment.partition("=")
        if not equals:
            raise ValueError(f"--set {assignment}: expected NAME=VALUE")
        field = find(fields, name.replace("-", "_"))
        if field is None:
            raise ValueError(f"--set: no field named '{name}'{suggestion(name, [one.option for one in fields])}")
        values[field.name] = field.of_text(text, field.option)
    return values


def complete(action: argparse.Action, words: Sequence[str]) -> argparse.Action:
    """Makes these words the completions of an option or argument."""
    setattr(action, "completions", words)  # noqa: B010  # argparse declares no such attribute
    return action


def place_of(action: argparse.Action) -> str:
    """Name of an argument that is not an option: ``TASK``."""
    return action.metavar if isinstance(action.metavar, str) else action.dest


def type_of(action: argparse.Action) -> str:
    """``INT``, ``auto|shapes|real``; empty for an option without a value."""
    if action.nargs == 0 or isinstance(action, argparse.BooleanOptionalAction):
        return ""
    if isinstance(action.metavar, str):
        return action.metavar
    words = "|".join(map(str, action.choices or ()))
    return words if words and len(words) <= 24 else {int: "INT", float: "FLOAT"}.get(action.type, "TEXT")  # pyright: ignore[reportArgumentType,reportCallIssue]


def _help_of(action: argparse.Action) -> str:
    kind = type_of(action)
    kind += " ..." if action.nargs in ("+", "*") else ""
    name = ",".join(action.option_strings) or place_of(action)
    text = (action.help or "").replace("%%", "%")
    text += " Required." if action.required and action.nargs not in ("?", "*") else ""
    field = getattr(action, "field", None)
    default = getattr(action, "shown_default", field.default if field else "")
    text += f" (default: {default})" if default else ""
    return entry(f"{name} {kind}" if kind and kind != name else name, text)
