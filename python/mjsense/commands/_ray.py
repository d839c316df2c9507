# SPDX-License-Identifier: Apache-2.0
"""Options of the commands that run on Ray."""

from __future__ import annotations

import argparse
from typing import Any


def add_ray(parser: argparse.ArgumentParser, verb: str = "Run") -> None:
    """Adds ``--ray`` and the options of its runtime environment."""
    parser.add_argument(
        "--ray", metavar="ADDRESS", help=f"{verb} on a Ray cluster: local (the CPUs of this machine), auto, or its address."
    )
    parser.add_argument("--ray-working-dir", metavar="DIR", help="With --ray: directory with your code, sent to the workers.")
    parser.add_argument(
        "--ray-pip", metavar="NAMES", help="With --ray: Python packages that workers install, separated by commas."
    )


def ray_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Arguments ``address`` and ``runtime_env`` of the functions of ``mjsense.cluster``."""
    environment = {"working_dir": arguments.ray_working_dir, "pip": arguments.ray_pip and arguments.ray_pip.split(",")}
    return {"address": arguments.ray, "runtime_env": {name: value for name, value in environment.items() if value} or None}
