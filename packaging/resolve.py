# SPDX-License-Identifier: Apache-2.0
"""Prints the versions that pip would install for mjsense: alone, with its extras, and together with related packages. Installs
nothing.

    python packaging/resolve.py [NAME ...]
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]

ENVIRONMENTS: dict[str, list[str]] = {
    "alone": [],
    "all extras": [requirement for extra in EXTRAS.values() for requirement in extra],
    "mujoco": ["mujoco>=4.0,<4.1"],
    "mujoco 3.3": ["mujoco==3.3.*"],
    "mujoco 3.8": ["mujoco==3.8.*"],
    "mujoco 3.11": ["mujoco==3.11.*"],
    "mujoco 3.17": ["mujoco==3.17.*"],
    "mujoco-warp": ["mujoco-warp", "mujoco>=4.0,<4.1"],
    "gymnasium-robotics": ["gymnasium-robotics>=1.4", "mujoco==3.8.*"],
    "viewers": ["rerun-sdk>=0.22", "viser>=0.2"],
    "trainers": ["rsl-rl-lib", "stable-baselines3"],
    "trainers of pixels": ["stable-baselines3", "gymnasium[mujoco]", "dm_control", "robosuite", "mujoco==3.8.*"],
}
"""Name -> requirements in addition to those of mjsense."""


class Unavailable(RuntimeError):
    """The package index cannot be reached."""


def resolve(others: list[str]) -> dict[str, str]:
    """Name -> version of every package; ValueError with pip's message if the requirements conflict."""
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--dry-run",
        "--ignore-installed",
        "--quiet",
        "--disable-pip-version-check",
        "--only-binary=:all:",
        "--report=-",
        *PROJECT["dependencies"],
        *others,
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        said = done.stderr.strip()
        error = ValueError if "ResolutionImpossible" in said or "conflict" in said else Unavailable
        raise error(said[-2000:])
    return {item["metadata"]["name"]: item["metadata"]["version"] for item in json.loads(done.stdout)["install"]}


def main() -> None:
    for name in sys.argv[1:] or ENVIRONMENTS:
        print(f"== {name}")
        for package, version in sorted(resolve(ENVIRONMENTS[name]).items(), key=lambda item: item[0].lower()):
            print(f"{package}=={version}")


if __name__ == "__main__":
    main()
