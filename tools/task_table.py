# SPDX-License-Identifier: Apache-2.0
"""Measures how often the planners succeed, by task and robot, and writes the table of docs/tasks.md.

    python tools/task_table.py [--episodes 50] [--only TASK[/ROBOT[/SCENE]] ...]

Plays every pair of CASES without cameras. Each attempt is an episode with a different seed; failures are recorded, too. Scenes of
packages that are not installed are skipped with a message. Pairs that are not played keep their rows of the page. The page is
written after each pair.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
for build in ("release", "dev"):
    if (ROOT / "build" / build / "python").exists():
        sys.path.insert(0, str(ROOT / "build" / build / "python"))
        break

import mjsense as mjs
from mjsense.evaluation.intervals import wilson

PAGE = ROOT / "docs" / "tasks.md"
BEGIN, END = "<!-- task table -->", "<!-- end -->"
HOUSES = 30
# (task, robot, scene). Scene "": the task's default; "name:*": HOUSES houses with some episodes in each.
CASES = (
    *(("pick", robot, "") for robot in ("franka", "mobile_franka", "i2rt_yam", "bimanual_yam", "floating_rum", "rby1")),
    *(
        ("pick", "franka", scene)
        for scene in (
            "table",
            "tableware",
            "clutter",
            "shelf",
            "kitchen:*",
            "libero/kitchen",
            "libero/study",
            "libero/living_room",
        )
    ),
    ("pick", "i2rt_yam", "clutter"),
    ("pick", "i2rt_yam", "shelf"),
    ("pick", "rby1", "clutter"),
    *(("pick_and_place", robot, "") for robot in ("franka", "mobile_franka", "i2rt_yam", "bimanual_yam", "floating_rum", "rby1")),
    ("pick_and_place_next_to", "franka", ""),
    ("pick_and_place_color", "franka", ""),
    ("packing", "franka", ""),
    *(
        (task, robot, "")
        for task in ("open", "close")
        for robot in ("franka", "mobile_franka", "i2rt_yam", "bimanual_yam", "floating_rum", "rby1")
    ),
    *((task, "franka", scene) for task in ("open", "close") for scene in ("kitchen:*", "libero/kitchen", "libero/study")),
    ("door_opening", "rby1", ""),
    ("door_opening", "mobile_franka", ""),
    *(("door_opening", robot, "room_with_door:*") for robot in ("rby1", "mobile_franka")),
    *((task, robot, "") for task in ("nav_to_obj", "multi_task") for robot in ("rby1", "mobile_franka")),
    ("nav_and_pick", "mobile_franka", ""),
)


def approach_angles(episodes: list[dict[str, Any]]) -> list[float]:
    """Degrees between vertical and the approach direction of the last grasp, for the episodes with a grasp."""
    angles = []
    for episode in episodes:
        if episode["approach"] is not None:
            angles.append(float(np.degrees(np.arccos(np.clip(-episode["approach"], -1, 1)))))
    return angles


def episodes_of(path: Path) -> list[dict[str, Any]]:
    """For each episode, the number of retries and the z component of the grasp's approach direction (None without a grasp)."""
    found = []
    for file in sorted(path.glob("*.h5")):
        with h5py.File(file) as data:
            for episode in data.values():
                extra = episode["obs/extra"]
                retries = int(extra["policy_num_retries"][-1]) if "policy_num_retries" in extra else 0
                approach = None
                if "grasp_pose" in extra:
                    position, (w, x, y, z) = extra["grasp_pose"][-1][:3], extra["grasp_pose"][-1][3:]
                    if any(position):  # the identity means: no grasp
                        approach = float(w * w - x * x - y * y + z * z)
                found.append({"retries": retries, "approach": approach, "success": bool(episode["success"][-1])})
    return found


def play(task: str, robot: str, scene: str, episodes: int, **options: Any) -> dict[str, Any]:
    scenes = [scene]
    if scene.endswith(":*"):
        scenes = [f"{scene[:-1]}{house}" for house in range(HOUSES)]
        episodes = -(-episodes // HOUSES)
    parts, found = [], []
    begun = time.process_time()
    for one in scenes:
        with tempfile.TemporaryDirectory() as out:
            made = mjs.record(
                task,
                robot,
                out=out,
                scene=one,
                episodes=episodes,
                max_attempts=episodes,
                keep_failures=True,
                num_worlds=min(8, episodes),
                cameras=[],
                **options,
            )
            found += episodes_of(made.path)
            parts.append(made)
    seconds = time.process_time() - begun
    angles = approach_angles(found)
    lengths = [length for made in parts for length in made.lengths]
    failures: collections.Counter[str] = collections.Counter()
    for made in parts:
        failures.update(made.failures)
    played = max(1, sum(made.succeeded + made.failed for made in parts))
    return {
        "task": task,
        "robot": robot,
        "scene": scene,
        "episodes": played,
        "succeeded": sum(made.succeeded for made in parts),
        "length": float(np.median(lengths)) if lengths else 0.0,
        "retried": sum(e["retries"] > 0 for e in found) / max(1, len(found)),
        "steep": sum(a < 30 for a in angles) / len(angles) if angles else None,
        "steps_per_second": sum(made.steps for made in parts) / seconds,
        "failures": failures.most_common(3),
    }


def label(task: str, robot: str, scene: str) -> str:
    """The first two cells of a row."""
    where = f" in `{scene}`" if scene else ""
    if scene.endswith(":*"):
        where = f" in {HOUSES} of `{scene[:-2]}`"
    return f"| `{task}`{where} | {robot} |"


def row(r: dict[str, Any]) -> str:
    slanted = "" if r["steep"] is None else f"{1 - r['steep']:.0%}"
    why = "; ".join(f"{count} {what}" for what, count in r["failures"])
    low, high = wilson(r["succeeded"], r["episodes"])
    return (
        f"{label(r['task'], r['robot'], r['scene'])} {r['succeeded']} of {r['episodes']} | "
        f"{100 * low:.0f} to {100 * high:.0f} % | {r['length']:.0f} | {r['retried']:.0%} | {slanted} | "
        f"{r['steps_per_second']:.0f} | {why} |"
    )


def table(rows: list[str]) -> str:
    head = [
        "| task | robot | successful | 95 % interval | steps | retried | slanted | steps per CPU second | failures |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    return "\n".join([*head, *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=50)
    parser.add_argument("--only", nargs="*", default=[], metavar="TASK[/ROBOT[/SCENE]]")
    arguments = parser.parse_args()
    old = PAGE.read_text().split(BEGIN)[1].split(END)[0]
    rows = {case: line for case in CASES for line in old.splitlines() if line.startswith(label(*case))}
    for case in CASES:
        task, robot, scene = case
        if arguments.only and not {task, f"{task}/{robot}", f"{task}/{robot}/{scene}"} & set(arguments.only):
            continue
        try:
            rows[case] = row(play(*case, arguments.episodes))
        except ValueError as error:
            if "mjsense assets install" not in str(error):
                raise
            print(f"{task}/{robot} in {scene}: skipped: {error}", flush=True)
            continue
        print(rows[case], flush=True)
        before, rest = PAGE.read_text().split(BEGIN, 1)
        _, after = rest.split(END, 1)
        PAGE.write_text(f"{before}{BEGIN}\n{table([rows[case] for case in CASES if case in rows])}\n{END}{after}")


if __name__ == "__main__":
    main()
