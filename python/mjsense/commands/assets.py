# SPDX-License-Identifier: Apache-2.0
"""``mjsense assets``"""

from __future__ import annotations

import argparse

EXAMPLES = [
    ("mjsense assets install robosuite", "Install the objects of robosuite."),
    ("mjsense assets install robosuite libero", "Install the objects of both."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=["install"], help="What to do.")
    parser.add_argument("names", nargs="+", metavar="NAME", help="Sources of objects, such as robosuite or libero.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.tasks import assets

    for name in arguments.names:
        added = assets.install_objects(name)
        print(f"{name}: {len(added)} objects added" + (": " + ", ".join(added) if added else ", all were there"))
    return 0
