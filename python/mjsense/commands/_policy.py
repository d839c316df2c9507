# SPDX-License-Identifier: Apache-2.0
"""Arguments of a policy as options of a command."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any


def add_policy_options(parser: argparse.ArgumentParser) -> None:
    """Adds ``--policy-option``."""
    parser.add_argument(
        "--policy-option",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        dest="policy_options",
        help="An argument of the policy's class. May be repeated.",
    )


def policy_options(texts: Iterable[str]) -> dict[str, Any]:
    """The arguments by name. A value is a number, true or false, or a text."""
    import tomllib

    made: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ValueError(f"--policy-option {text}: expected NAME=VALUE")
        try:
            made[name] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            made[name] = value
    return made
