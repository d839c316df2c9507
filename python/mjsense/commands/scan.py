# SPDX-License-Identifier: Apache-2.0
"""``mjsense scan``"""

from __future__ import annotations

import argparse
import os

from mjsense.commands.parser import Parser, add_steps, field_values
from mjsense.commands.sensors import names_model

EXAMPLES = [
    ("mjsense scan embedded:scenes/table/room.xml --frame geom:table_top --out cloud.ply", "Scan a room from its table."),
    (
        "mjsense scan scene.xml --frame site:lidar --channels 32 --samples 1024 --out cloud.pcd",
        "Scan with 32 lasers and 1,024 firings per sweep.",
    ),
]
ENDS_AT_CTRL_C = True
# The scene does not move, so the rate of a scan and motion distortion have no effect.
_SKIPPED = ("rate_hz", "name", "any_frame", "debug_vis", "hit_ids", "motion_distortion")


def add_arguments(parser: Parser) -> None:
    parser.add_argument("scene", metavar="SCENE.xml", help="An MJCF file, or embedded:FILE.")
    parser.add_argument(
        "--frame",
        required=True,
        metavar="TYPE:NAME",
        help="The frame that carries the lidar: site:NAME, body:NAME, geom:NAME or camera:NAME.",
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="Output file, .ply or .pcd.")
    parser.add_fields("TableScanCfg", skip=_SKIPPED)
    parser.option("--table").metavar = "FILE.npy"
    parser.add_fields("SpinningScanCfg", skip=_SKIPPED)
    parser.add_fields("LidarSensorCfg", skip=_SKIPPED)
    add_steps(parser, "Number of physics steps before the scan.", 0)
    parser.add_argument("--world", action="store_true", help="Write the points in the world frame instead of the lidar's frame.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense import _core

    table, spinning = field_values(arguments, "TableScanCfg"), field_values(arguments, "SpinningScanCfg")
    if "file" in table and spinning:
        raise ValueError(f"--table excludes --{_flag('SpinningScanCfg', next(iter(spinning)))}; see mjsense scan --help")
    if table and "file" not in table:
        raise ValueError(f"--{_flag('TableScanCfg', next(iter(table)))} requires --table; see mjsense scan --help")
    if "file" in table and not os.path.exists(table["file"]):
        raise ValueError(f"--table: File does not exist: {table['file']}; see mjsense scan --help")
    kind, colon, name = arguments.frame.partition(":")
    if not colon:
        raise ValueError(f"--frame {arguments.frame}: expected a type and a name, such as site:head")
    if not names_model(arguments.scene, "an MJCF file"):
        raise ValueError(f"'{arguments.scene}': no such file")
    returns, rays = _core.scan(
        arguments.scene,
        kind,
        name,
        field_values(arguments, "LidarSensorCfg"),
        table or spinning,
        arguments.out,
        arguments.steps,
        arguments.world,
    )
    print(f"{arguments.out}: {returns} of {rays} rays returned")
    return 0


def _flag(struct: str, name: str) -> str:
    from mjsense.commands.table import FIELDS

    return next(field.flag.replace("_", "-") for field in FIELDS[struct] if field.name == name)
