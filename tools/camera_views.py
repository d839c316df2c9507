# SPDX-License-Identifier: Apache-2.0
"""Measures how often the default cameras show the objects of the task in the first frame of an episode.

    python tools/camera_views.py [--episodes 200] [--only TASK[/ROBOT]] [--scene SCENE] [--at-least 0.95]

For each task and robot, starts episodes without playing them, with small images, and counts the starts in which at least one
camera that is not on a wrist shows every object of the task (object and receptacle, or the handle). Prints a table; with
--at-least the exit code is 1 if a pair is below that share. Navigation is excluded, because its object is not visible at the
start.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
for build in ("release", "dev"):
    if (ROOT / "build" / build / "python").exists():
        sys.path.insert(0, str(ROOT / "build" / build / "python"))
        break

import mjsense as mjs

ARMS = ("franka", "mobile_franka", "i2rt_yam", "bimanual_yam", "floating_rum", "rby1")
PAIRS = (
    *((task, robot) for task in ("pick", "pick_and_place", "open", "close") for robot in ARMS),
    *((task, "franka") for task in ("pick_and_place_next_to", "pick_and_place_color", "packing")),
    *(("door_opening", robot) for robot in ("rby1", "mobile_franka")),
)
WORLDS = 8
SHRINK = 2  # factor for width and height of the images; not used for door handles, which are too thin


@dataclass
class Count:
    """Counts for one task and robot."""

    starts: int = 0
    refused: int = 0  # episodes that could not be started
    all_seen: int = 0  # starts in which one camera shows every object
    seen: dict[str, int] = field(default_factory=dict)  # starts in which some camera shows it, by role

    @property
    def share(self) -> float:
        return self.all_seen / max(1, self.starts)


def picture_size(task: str, robot: str, scene: str) -> tuple[int, int]:
    with closing(mjs.make_vec(task, robot, scene=scene)) as env:
        height, width = next(spec.shape[:2] for spec in env.specs.values() if len(spec.shape) == 3)
    shrink = 1 if task == "door_opening" else SHRINK
    return width // shrink, height // shrink


def count(task: str, robot: str, scene: str = "", episodes: int = 200, seed: int = 0) -> Count:
    found = Count()
    width, height = picture_size(task, robot, scene)
    worlds = min(WORLDS, episodes)
    with closing(
        mjs.make_vec(
            task,
            robot,
            scene=scene,
            num_envs=worlds,
            seed=seed,
            width=width,
            height=height,
            shadows=False,
            observations=["object_image_points"],
        )
    ) as env:
        while found.starts + found.refused < episodes:
            points = env.reset()[0]["object_image_points"]
            faults = env._rollout.outcomes()[-1]  # failed starts are not visible in the first observation
            roles = {role: cameras for role, cameras in points.items() if "gripper" not in role}
            shown = {
                role: [rows["num_points"][:, 0] > 0 for camera, rows in cameras.items() if "wrist" not in camera]
                for role, cameras in roles.items()
            }
            for world in range(min(worlds, episodes - found.starts - found.refused)):
                if world in faults:
                    found.refused += 1
                    continue
                found.starts += 1
                for role, cameras in shown.items():
                    found.seen[role] = found.seen.get(role, 0) + any(camera[world] for camera in cameras)
                found.all_seen += any(all(cameras[world] for cameras in one) for one in zip(*shown.values(), strict=True))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="TASK or TASK/ROBOT")
    parser.add_argument("--scene", default="", help="instead of the task's own")
    parser.add_argument("--at-least", type=float, default=0.0, help="share of starts below which the exit code is 1")
    arguments = parser.parse_args()
    low = 0
    print("| task | robot | all in one view | of them | by object | refused |\n| --- | --- | ---: | ---: | --- | ---: |")
    for task, robot in PAIRS:
        if arguments.only not in ("", task, f"{task}/{robot}"):
            continue
        found = count(task, robot, arguments.scene, arguments.episodes, arguments.seed)
        each = ", ".join(f"{role} {seen / max(1, found.starts):.0%}" for role, seen in found.seen.items())
        print(f"| {task} | {robot} | {found.share:.1%} | {found.starts} | {each} | {found.refused} |", flush=True)
        low += found.share < arguments.at_least
    return int(low > 0)


if __name__ == "__main__":
    sys.exit(main())
