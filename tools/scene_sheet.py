# SPDX-License-Identifier: Apache-2.0
"""Writes docs/pictures/scene_sheet.jpg, built-in scenes above those of robosuite and LIBERO: python tools/scene_sheet.py.

Two rows of scenes of mjsense, one of robosuite and one of LIBERO. Theirs are drawn by robosuite's own renderer, at the start of
an episode. Needs ffmpeg, OpenGL, and a Python with mjsense, robosuite 1.4 (for LIBERO's environments) and LIBERO.
"""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import robosuite  # pyright: ignore[reportMissingImports]
from libero.libero import get_libero_path  # pyright: ignore[reportMissingImports]
from libero.libero.envs import OffScreenRenderEnv  # pyright: ignore[reportMissingImports]
from scene_pictures import HEIGHT, PICTURES, VIEWS, WIDTH, View, picture, write_jpeg

OURS = [
    "scene_table",
    "scene_varied_table",
    "scene_tableware",
    "scene_clutter",
    "scene_shelf",
    "scene_kitchen",
    "scene_room_with_door",
    "scene_floor",
]
ROBOSUITE = ["Lift", "PickPlace", "NutAssembly", "Door"]
TABLE = View("pick", "table", pos=(-1.3, -1.1, 1.65), target=(-0.1, 0.0, 0.85))  # as scene_table, in robosuite's coordinates
LIBERO = {
    "libero_goal/*": VIEWS["scene_libero_table"],
    "libero_90/KITCHEN_SCENE1_*": VIEWS["scene_libero_kitchen"],
    "libero_90/LIVING_ROOM_SCENE1_*": VIEWS["scene_libero_living_room"],
    "libero_90/STUDY_SCENE1_*": VIEWS["scene_libero_study"],
}


def drawn_by_robosuite(env: Any, view: View) -> np.ndarray:
    """The start of an episode from the camera of `view`, [H, W, 3]."""
    assert view.pos is not None
    env.reset()
    model = env.sim.model
    camera = model.camera_name2id("agentview")
    back = np.subtract(view.pos, view.target)
    back /= np.linalg.norm(back)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.stack([right, np.cross(back, right), back], axis=1).ravel())
    model.cam_pos[camera], model.cam_quat[camera], model.cam_fovy[camera] = view.pos, quat, 62
    env.sim.forward()
    pixels = env.sim.render(camera_name="agentview", width=WIDTH, height=HEIGHT)[::-1]
    env.close()
    return pixels


def main() -> None:
    np.random.seed(0)
    tiles = [picture(VIEWS[name])[:, :WIDTH] for name in OURS]
    for task in ROBOSUITE:
        env = robosuite.make(task, robots="Panda", has_renderer=False, has_offscreen_renderer=True, use_camera_obs=False)
        tiles.append(drawn_by_robosuite(env, TABLE))
    for pattern, view in LIBERO.items():
        task = min(Path(get_libero_path("bddl_files")).glob(f"{pattern}.bddl"))
        tiles.append(drawn_by_robosuite(OffScreenRenderEnv(bddl_file_name=str(task)), view))
    rows = [np.concatenate(tiles[i : i + 4], axis=1) for i in range(0, len(tiles), 4)]
    write_jpeg(PICTURES / "scene_sheet.jpg", np.concatenate(rows))


if __name__ == "__main__":
    main()
