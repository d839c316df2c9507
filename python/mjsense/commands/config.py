# SPDX-License-Identifier: Apache-2.0
"""Experiment files: TOML with the options of a command, with ``_`` instead of ``-``. Options of the command line have
priority."""

from __future__ import annotations

import argparse
import os
import re
import stat
from collections.abc import Callable, Sequence
from typing import Any

from mjsense.commands.fields import suggestion
from mjsense.commands.parser import Parser

_MAX_BYTES = 16 << 20
_KINDS = {str: (str, "a str"), int: (int, "an int"), float: ((int, float), "a number"), bool: (bool, "a bool")}


def files_of(words: Sequence[str]) -> list[str]:
    """The values of ``--config`` on a command line."""
    before_end = words[: words.index("--")] if "--" in words else words
    return [
        before_end[i + 1] if word == "--config" else word.partition("=")[2]
        for i, word in enumerate(before_end)
        if (word == "--config" and i + 1 < len(before_end)) or word.startswith("--config=")
    ]


def apply(parser: Parser, path: str) -> None:
    """Makes the values of a file the defaults of the parser.

    Raises:
        ValueError: The file cannot be read, or is not valid; the message names the line.
    """
    import tomllib  # slow to import

    text = _text_of(path)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.fullmatch(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", str(error), re.DOTALL)
        line = (found[2] if found else None) or text.count("\n") + 1
        raise ValueError(f"{path}:{line}: {found[1] if found else error}") from None
    keys = _keys_of(parser)
    for name, value in table.items():
        place = f"{path}:{_line_of(text, name)}"
        if name not in keys:
            raise ValueError(f"{place}: no key named '{name}'{suggestion(name, keys)}")
        keys[name](value, place)


def _text_of(path: str) -> str:
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        raise ValueError(
            f"{path or repr(path)}: {'no such file' if isinstance(error, FileNotFoundError) else error.strerror}"
        ) from None
    if not stat.S_ISREG(mode):
        kind = "folder" if stat.S_ISDIR(mode) else "pipe" if stat.S_ISFIFO(mode) else "device"
        raise ValueError(f"{path}: is a {kind}, expected a file")
    try:
        with open(path, "rb") as file:
            content = file.read(_MAX_BYTES + 1)
        if len(content) > _MAX_BYTES:
            raise ValueError(f"{path}: has more than {_MAX_BYTES >> 20} MiB")
        return content.decode().replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"{path}:{line}: is not UTF-8") from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None


def _line_of(text: str, key: str) -> int:
    """The line in which a key of the top level is set."""
    found = re.search(rf"""^[ \t\[]*["']?{re.escape(key)}\b""", text, re.MULTILINE)
    return text.count("\n", 0, found.start()) + 1 if found else 1


def _keys_of(parser: Parser) -> dict[str, Callable[[Any, str], None]]:
    """What each key does with its value."""
    keys: dict[str, Callable[[Any, str], None]] = {}
    for action in parser._actions:
        if action.dest in ("help", "config"):
            continue
        if not action.option_strings:
            keys[action.dest] = _setter(parser, action)
        for option in action.option_strings:
            if option.startswith("--"):
                keys[option[2:].replace("-", "_")] = _setter(parser, action, option.startswith("--no-"))
    for field in parser.fields:  # after the actions: a field states its type itself, and both forms of a flag are keys

        def put(value: Any, place: str, field: Any = field, opposite: bool = False) -> None:
            value = field.of_toml(value, place)
            parser.set_defaults(**{field.name: value != opposite if field.kind == "bool" else value})

        keys[field.option] = put
        if field.kind == "bool":
            keys[f"no_{field.option}"] = lambda value, place, put=put: put(value, place, opposite=True)
    return keys


def _setter(parser: Parser, action: argparse.Action, opposite: bool = False) -> Callable[[Any, str], None]:
    is_flag = action.nargs == 0 or isinstance(action, argparse.BooleanOptionalAction)
    is_list = action.nargs in ("+", "*") or isinstance(action, argparse._AppendAction)
    given = getattr(action.type, "kind", action.type)
    types, kind = _KINDS[bool if is_flag else given if given in _KINDS else str]  # pyright: ignore[reportArgumentType]

    def put(value: Any, place: str) -> None:
        name = action.dest
        values = value if is_list and isinstance(value, list) else [value]
        if not all(isinstance(one, types) and isinstance(one, bool) == is_flag for one in values):
            raise ValueError(
                f"{place}: the value of '{name}' has the wrong type: must be {'a list, each ' if is_list else ''}{kind}"
            )
        if is_flag:
            constant = getattr(action, "const", None)
            chosen = value != opposite if constant is None else constant if value else action.default
        else:
            try:
                made = [action.type(str(one)) if callable(action.type) else one for one in values]
            except (argparse.ArgumentTypeError, ValueError) as error:
                raise ValueError(f"{place}: {name}: {error}") from None
            if action.choices is not None and (wrong := [one for one in made if one not in action.choices]):
                words = ", ".join(map(str, action.choices))
                raise ValueError(
                    f"{place}: {name} is '{wrong[0]}': must be one of "
                    f"{words}{suggestion(str(wrong[0]), map(str, action.choices))}"
                )
            chosen = made if is_list else made[0]
        parser.set_defaults(**{name: chosen})
        action.required = False
        if not action.option_strings:
            action.nargs = {None: "?", "+": "*"}.get(action.nargs, action.nargs)  # pyright: ignore[reportAttributeAccessIssue,reportCallIssue,reportArgumentType]

    return put
