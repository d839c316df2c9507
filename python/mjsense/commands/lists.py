# SPDX-License-Identifier: Apache-2.0
"""``mjsense tasks``, ``robots``, ``scenes`` and ``objects``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands.output import table
from mjsense.commands.parser import Parser, text_width, wrapped

EXAMPLES = [("mjsense {name}", "Print the list."), ("mjsense {name} --json", "Print the list as JSON.")]
ENDS_AT_CTRL_C = True


def add_arguments(parser: Parser) -> None:
    parser.add_argument("--json", action="store_true", help="Print JSON.")


def run(arguments: argparse.Namespace) -> int:
    import json

    from mjsense import _core

    text = getattr(_core, f"{arguments.command}_json")()
    print(text if arguments.json else (_table if arguments.command == "objects" else _lines)(json.loads(text)))
    return 0


def _lines(listed: list[dict[str, str]]) -> str:
    lines = []
    for one in listed:
        lines.append(one["name"])
        for text in (one["description"], one["needs"] and f"Needs: {one['needs']}"):
            lines += [f"    {line}" for line in wrapped(text, text_width() - 4) if line]
    return "\n".join(lines)


def _table(objects: list[dict[str, Any]]) -> str:
    rows = []
    for one in objects:
        note = f"not used: {one['excluded']}" if one["excluded"] else "receptacle" if one["receptacle"] else ""
        rows.append([one["name"], one["kind"], one["source"], one["license"], "yes" if one["installed"] else "no", note])
    return table(("name", "kind", "source", "licence", "installed", ""), rows)
