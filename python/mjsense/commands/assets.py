# SPDX-License-Identifier: Apache-2.0
"""``mjsense assets``"""

from __future__ import annotations

import argparse

from mjsense.core.counted import counted

EXAMPLES = [
    ("mjsense assets install robosuite", "Install the objects of robosuite."),
    ("mjsense assets install robosuite libero", "Install the objects of both."),
    ("mjsense assets convert chair.glb chair", "Write a model with its materials as MJCF."),
    ("mjsense assets convert room.glb room --no-contacts", "The same for surroundings that are only seen."),
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=["install", "convert"], help="What to do.")
    parser.add_argument(
        "names",
        nargs="+",
        metavar="NAME",
        help="install: sources of objects, such as robosuite. convert: a .glb, .gltf or .obj file, and the folder to make.",
    )
    parser.add_argument(
        "--up", choices=["y", "z"], help="convert: the axis that points up in the file; by default y, and z for .obj."
    )
    parser.add_argument("--scale", type=float, default=1.0, metavar="X", help="convert: metres of one unit of the file.")
    parser.add_argument("--no-contacts", action="store_true", help="convert: leave out the convex hulls for contacts.")


def run(arguments: argparse.Namespace) -> int:
    if arguments.action == "convert":
        from mjsense.scene import convert_assets

        if len(arguments.names) != 2:
            raise ValueError(f"mjsense assets convert takes a file and the folder to make, got {len(arguments.names)} names")
        source, out = arguments.names
        made = convert_assets(source, out, up=arguments.up, scale=arguments.scale, contacts=not arguments.no_contacts)
        print(f"{source}: written as {made}")
        return 0
    from mjsense.tasks import assets

    for name in arguments.names:
        added = assets.install_objects(name)
        print(f"{name}: {counted(len(added), 'object')} added" + (": " + ", ".join(added) if added else ", all were there"))
    return 0
