# SPDX-License-Identifier: Apache-2.0
"""Writes the pictures of the scenes and tasks into docs/pictures: python tools/scene_pictures.py [NAME ...].

Each picture shows two episodes, played by the planner up to this moment. Pictures of scenes from packages that are not installed
are skipped. Needs ffmpeg.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mjsense as mjs

PICTURES = Path(__file__).parents[1] / "docs/pictures"
WIDTH, HEIGHT = 400, 280


class View(NamedTuple):
    task: str
    scene: str
    robot: str = "franka"
    steps: int = 45
    pos: tuple[float, float, float] | None = (-0.5, -1.1, 1.4)  # m, camera; None: the robot's head_camera
    target: tuple[float, float, float] = (0.7, 0.0, 0.6)
    seed: int = 3


def in_kitchen(task: str, steps: int = 45, seed: int = 3) -> View:
    return View(task, "kitchen", steps=steps, seed=seed, pos=(-2.0, -1.2, 1.7), target=(0.3, 0.0, 0.95))


VIEWS = {
    "scene_table": View("pick", "table"),
    "scene_varied_table": View("pick", "varied_table"),
    "scene_tableware": View("pick", "tableware", steps=5),
    "scene_clutter": View("pick", "clutter"),
    "scene_shelf": View("pick", "shelf", pos=(-1.1, -1.1, 1.6), target=(0.6, 0.0, 0.85)),
    "scene_kitchen": in_kitchen("open"),
    "scene_kitchen_1": View("close", "kitchen:1", pos=(-1.9, 0.9, 1.6), target=(0.3, 0.0, 0.95)),
    "scene_room_with_door": View(
        "door_opening", "room_with_door", "rby1", steps=3, pos=(-3.1, 1.3, 1.75), target=(0.0, -0.15, 0.95), seed=4
    ),
    "scene_floor": View("nav_to_obj", "floor", "rby1", steps=3, pos=(0.4, 0.4, 2.4), target=(4.0, 3.5, 0.3)),
    "scene_libero_kitchen": View("pick", "libero/kitchen", pos=(-1.1, -1.3, 1.7), target=(-0.2, 0.0, 0.9)),
    "scene_libero_table": View("pick", "libero/table", pos=(-1.1, -1.3, 1.7), target=(-0.2, 0.0, 0.9)),
    "scene_libero_coffee_table": View("pick", "libero/coffee_table", pos=(-1.0, -1.4, 1.3), target=(-0.2, 0.0, 0.5)),
    "scene_libero_study": View("pick", "libero/study", pos=(0.55, 0.95, 1.7), target=(-0.65, -0.1, 0.95)),
    "scene_libero_living_room": View("pick", "libero/living_room", pos=(0.6, -1.3, 1.4), target=(-0.7, 0.1, 0.6)),
    "scene_gymnasium_robotics_kitchen": View("open", "gymnasium_robotics/kitchen", pos=(1.0, -1.3, 2.5), target=(-0.3, 0.3, 1.7)),
    "task_pick": View("pick", "varied_table", steps=65),
    "task_pick_and_place": View("pick_and_place", "tableware", steps=125),
    "task_pick_and_place_next_to": View("pick_and_place_next_to", "tableware", steps=125),
    "task_pick_and_place_color": View("pick_and_place_color", "tableware", steps=125),
    "task_packing": View("packing", "tableware", steps=125),
    "task_open": in_kitchen("open", steps=125, seed=4),
    "task_close": in_kitchen("close", steps=75),
    "task_door_opening": View("door_opening", "room_with_door", "rby1", steps=165, pos=None),
    "task_multi_task": in_kitchen("open+pick", steps=60),
    "task_nav_to_obj": View("nav_to_obj", "floor", "rby1", steps=70, pos=None, seed=4),
}


def write_jpeg(path: Path, pixels: np.ndarray) -> None:
    height, width, _ = pixels.shape
    subprocess.run(
        [
            "ffmpeg",
            "-nostdin",
            "-hide_banner",
            "-loglevel",
            "error",
            "-y",
            "-f",
            "rawvideo",
            "-pixel_format",
            "rgb24",
            "-video_size",
            f"{width}x{height}",
            "-i",
            "-",
            "-frames:v",
            "1",
            "-q:v",
            "5",
            str(path),
        ],
        input=np.ascontiguousarray(pixels).tobytes(),
        check=True,
    )


def picture(view: View, num_envs: int = 2, **images: Any) -> np.ndarray:
    """Episodes side by side, [H, num_envs * W, 3]. `images`: options of images."""
    where = 'mount = "mjcf"\ncamera = "head_camera"\n'
    if view.pos is not None:
        where = f'mount = "fixed"\npos = {list(view.pos)}\ntarget = {list(view.target)}\nfovy = 62\n'
    with tempfile.TemporaryDirectory() as folder:
        cameras = Path(folder, "cameras.toml")
        cameras.write_text(f'width = {WIDTH}\nheight = {HEIGHT}\n[[cameras]]\nname = "view_camera"\n{where}')
        env = mjs.make_vec(
            view.task,
            view.robot,
            scene=view.scene,
            num_envs=num_envs,
            camera_system=str(cameras),
            observations=["view_camera"],
            **{"samples": 4, **images},
            seed=view.seed,
            policy="planner",
        )
        env.reset()
        for _ in range(view.steps):
            observation = env.step(env.expert_action())[0]
        env.close()
    return np.concatenate(list(observation["view_camera"]), axis=1)


def main() -> None:
    for name in sys.argv[1:] or VIEWS:
        try:
            pixels = picture(VIEWS[name])
        except ValueError as error:
            print(f"{name}: skipped: {error}")
            continue
        path = PICTURES / f"{name}.jpg"
        write_jpeg(path, pixels)
        print(f"{path}: {path.stat().st_size} B", flush=True)


if __name__ == "__main__":
    main()
