# SPDX-License-Identifier: Apache-2.0
"""``mjsense schema``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense schema > schema.json", "Keep the schema in a file."),
    ("mjsense schema | python -m json.tool | less", "Page through the schema."),
]
ENDS_AT_CTRL_C = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has no arguments."""


def run(arguments: argparse.Namespace) -> int:
    from mjsense import _core

    print(_core.schema())
    return 0
