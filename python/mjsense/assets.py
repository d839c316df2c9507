# SPDX-License-Identifier: Apache-2.0
"""Meshes that other installed packages bring. Robots are drawn with shapes of our own without them; motion is the same."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

_FRANKA = "MJSENSE_FRANKA_MESHES"


def franka_meshes() -> Path | None:
    """The folder of the Franka's meshes in gymnasium-robotics (extra ``assets``), None without it. Imports nothing."""
    spec = importlib.util.find_spec("gymnasium_robotics")
    for root in (spec.submodule_search_locations or ()) if spec else ():
        folder = Path(root, "envs", "assets", "kitchen_franka", "franka_assets", "meshes", "visual")
        if (folder / "link0.stl").is_file():
            return folder
    return None


def use_installed_meshes() -> None:
    """Draws robots with the meshes there are, for tasks made from now on. ``MJSENSE_FRANKA_MESHES``, even if empty, has priority."""
    if _FRANKA not in os.environ and (folder := franka_meshes()):
        os.environ[_FRANKA] = str(folder)


if __name__ == "__main__":
    print(franka_meshes() or "")
